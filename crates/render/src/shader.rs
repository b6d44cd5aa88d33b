//! Shader sources. A line `#import file.wgsl` stands for that file's text; imports do not nest.

/// Sources that others import, by name.
const SHARED: [(&str, &str); 2] = [
    ("splat_params.wgsl", include_str!("shader/splat_params.wgsl")),
    ("light_params.wgsl", include_str!("shader/light_params.wgsl")),
];

/// Replaces the import lines of a pass by what they name.
///
/// # Panics
/// When there is no such file: sources are ours.
pub(crate) fn resolve(source: &str) -> String {
    source
        .lines()
        .map(|line| match line.strip_prefix("#import ") {
            Some(name) => SHARED.iter().find(|(known, _)| *known == name).expect("imports name shared sources").1,
            None => line,
        })
        .flat_map(|line| [line, "\n"])
        .collect()
}

pub(crate) fn module(device: &wgpu::Device, label: &str, source: &str) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(resolve(source).into()),
    })
}

/// Compares a host struct with its WGSL twin: same names in the same order, same offsets, same size.
#[cfg(test)]
macro_rules! assert_same_layout {
    ($host:ident, $source:expr, [$($field:ident),+ $(,)?]) => {
        crate::shader::tests::compare(
            stringify!($host),
            $source,
            size_of::<$host>(),
            &[$((stringify!($field), std::mem::offset_of!($host, $field))),+],
        )
    };
}
#[cfg(test)]
pub(crate) use assert_same_layout;

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use naga::front::wgsl;
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    pub(crate) fn compare(name: &str, source: &str, host_size: usize, host_fields: &[(&str, usize)]) {
        let module = wgsl::parse_str(&resolve(source)).expect("it is valid WGSL");
        let twin = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).expect("the struct is there").1;
        let naga::TypeInner::Struct { members, span } = &twin.inner else { panic!("{name} is not a struct") };
        let fields: Vec<(&str, usize)> =
            members.iter().map(|member| (member.name.as_deref().unwrap_or("?"), member.offset as usize)).collect();
        assert_eq!(fields, host_fields, "fields and offsets of {name}");
        assert_eq!(*span as usize, host_size, "size of {name}");
    }

    #[test]
    fn every_pass_is_valid_without_a_gpu_and_without_extensions() {
        for (name, source) in [("splats", crate::splats::SOURCE), ("light", crate::light::SOURCE)] {
            let module = wgsl::parse_str(&resolve(source)).unwrap_or_else(|error| panic!("{name}: {error}"));
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            validator.validate(&module).unwrap_or_else(|error| panic!("{name}: {error:?}"));
        }
    }
}
