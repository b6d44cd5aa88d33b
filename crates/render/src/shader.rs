//! Shader sources. A line `#import file.wgsl` stands for that file's text; imports do not nest. The import `splat_target.wgsl`
//! stands for one of several files: where a pass delivers what it draws.

/// Sources that others import, by name.
const SHARED: [(&str, &str); 22] = [
    ("dot.wgsl", include_str!("shader/dot.wgsl")),
    ("hybrid_fade.wgsl", include_str!("shader/hybrid_fade.wgsl")),
    ("hybrid_kinds.wgsl", include_str!("shader/hybrid_kinds.wgsl")),
    ("hybrid_params.wgsl", include_str!("shader/hybrid_params.wgsl")),
    ("hybrid_place.wgsl", include_str!("shader/hybrid_place.wgsl")),
    ("hybrid_gaps.wgsl", include_str!("shader/hybrid_gaps.wgsl")),
    ("hybrid_spots.wgsl", include_str!("shader/hybrid_spots.wgsl")),
    ("hybrid_store.wgsl", include_str!("shader/hybrid_store.wgsl")),
    ("hybrid_target.wgsl", include_str!("shader/hybrid_target.wgsl")),
    ("hybrid_triangle.wgsl", include_str!("shader/hybrid_triangle.wgsl")),
    ("light_params.wgsl", include_str!("shader/light_params.wgsl")),
    ("nearness.wgsl", include_str!("shader/nearness.wgsl")),
    ("splat_keys_32.wgsl", include_str!("shader/splat_keys_32.wgsl")),
    ("splat_keys_64.wgsl", include_str!("shader/splat_keys_64.wgsl")),
    ("splat_keys_64_found.wgsl", include_str!("shader/splat_keys_64_found.wgsl")),
    ("splat_nearness.wgsl", include_str!("shader/splat_nearness.wgsl")),
    ("splat_params.wgsl", include_str!("shader/splat_params.wgsl")),
    ("splat_parts.wgsl", include_str!("shader/splat_parts.wgsl")),
    ("splat_shape.wgsl", include_str!("shader/splat_shape.wgsl")),
    ("splat_store.wgsl", include_str!("shader/splat_store.wgsl")),
    ("splat_sums.wgsl", include_str!("shader/splat_sums.wgsl")),
    ("splat_surface.wgsl", include_str!("shader/splat_surface.wgsl")),
];

/// Where a splat pass delivers what it draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// Nowhere: the pass does not import `splat_target.wgsl`.
    None,
    /// Keys of 64 bits.
    Keys64,
    /// Keys of 64 bits, of which some have been found before.
    Keys64Found,
    /// Keys of two words.
    Keys32,
    /// Sums.
    Sums,
}

impl Target {
    fn file(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Keys64 => "splat_keys_64.wgsl",
            Self::Keys64Found => "splat_keys_64_found.wgsl",
            Self::Keys32 => "splat_keys_32.wgsl",
            Self::Sums => "splat_sums.wgsl",
        }
    }
}

/// Replaces the import lines of a pass by what they name.
///
/// # Panics
/// When there is no such file: sources are ours.
pub(crate) fn resolve(source: &str, target: Target) -> String {
    source
        .lines()
        .map(|line| match line.strip_prefix("#import ") {
            Some(name) => {
                let name = if name == "splat_target.wgsl" { target.file() } else { name };
                SHARED.iter().find(|(known, _)| *known == name).expect("imports name shared sources").1
            }
            None => line,
        })
        .flat_map(|line| [line, "\n"])
        .collect()
}

pub(crate) fn module(device: &wgpu::Device, label: &str, source: &str, target: Target) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(resolve(source, target).into()),
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
        let module = wgsl::parse_str(&resolve(source, Target::Keys32)).expect("it is valid WGSL");
        let twin = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).expect("the struct is there").1;
        let naga::TypeInner::Struct { members, span } = &twin.inner else { panic!("{name} is not a struct") };
        let fields: Vec<(&str, usize)> =
            members.iter().map(|member| (member.name.as_deref().unwrap_or("?"), member.offset as usize)).collect();
        assert_eq!(fields, host_fields, "fields and offsets of {name}");
        assert_eq!(*span as usize, host_size, "size of {name}");
    }

    #[test]
    fn every_pass_is_valid_without_a_gpu_and_needs_only_what_it_says() {
        let wide = Capabilities::SHADER_INT64 | Capabilities::SHADER_INT64_ATOMIC_MIN_MAX;
        let baseline = Capabilities::empty();
        let light = [("light", crate::light::SOURCE, Target::None, baseline)];
        let needed = |(name, source, target)| {
            (name, source, target, if matches!(target, Target::Keys64 | Target::Keys64Found) { wide } else { baseline })
        };
        let splats = crate::splats::sources().map(needed);
        let hybrid = crate::hybrid::sources().map(needed);
        for (name, source, target, capabilities) in light.into_iter().chain(splats).chain(hybrid) {
            let text = resolve(source, target);
            let module =
                wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(&text)));
            let mut validator = Validator::new(ValidationFlags::all(), capabilities);
            validator.validate(&module).unwrap_or_else(|error| panic!("{name} {target:?}: {error:?}"));
        }
    }
}
