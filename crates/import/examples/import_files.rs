//! Writes one model in the formats that large real files are rarely found in, for `import_speed`.
//!
//! `cargo run --release -p gigalod-import --example import_files -- MODEL FOLDER` writes `model.obj`, `.off`, `.stl` (binary),
//! `_text.stl`, `.xyz`, `.pcd` (binary) and `.e57` (scaled integers) there, and prints their paths, one a line.

use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use gigalod_import::{open, read_all};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// A name, and what writes it.
type Writer = (&'static str, fn(&Model, &mut dyn Write) -> std::io::Result<()>);

struct Model {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, folder] = &arguments[..] else { return Err("usage: import_files MODEL FOLDER".into()) };
    let mut stream = open(Box::new(File::open(model)?))?;
    let batch = read_all(&mut *stream, &mut |_, _| {})?;
    let positions = batch.vertices.positions.iter().map(|position| position.to_array()).collect();
    let model = Model { positions, triangles: batch.triangles };
    let folder = Path::new(folder);
    let writers: [Writer; 6] = [
        ("model.obj", obj),
        ("model.off", off),
        ("model.stl", stl),
        ("model_text.stl", stl_text),
        ("model.xyz", xyz),
        ("model.pcd", pcd),
    ];
    for (name, write) in writers {
        let path = folder.join(name);
        let mut file = BufWriter::new(File::create(&path)?);
        write(&model, &mut file)?;
        file.flush()?;
        println!("{}", path.display());
    }
    let path = folder.join("model.e57");
    e57(&model, &path)?;
    println!("{}", path.display());
    Ok(())
}

fn obj(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    for [x, y, z] in &model.positions {
        writeln!(out, "v {x} {y} {z}")?;
    }
    model.triangles.iter().try_for_each(|[a, b, c]| writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1))
}

fn off(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(out, "OFF\n{} {} 0", model.positions.len(), model.triangles.len())?;
    xyz(model, out)?;
    model.triangles.iter().try_for_each(|[a, b, c]| writeln!(out, "3 {a} {b} {c}"))
}

fn stl(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    out.write_all(&[b' '; 80])?;
    out.write_all(&(model.triangles.len() as u32).to_le_bytes())?;
    for triangle in &model.triangles {
        out.write_all(&[0; 12])?;
        for corner in triangle {
            let position = model.positions[*corner as usize];
            position.iter().try_for_each(|value| out.write_all(&(*value as f32).to_le_bytes()))?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

fn stl_text(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(out, "solid model")?;
    for triangle in &model.triangles {
        writeln!(out, "facet normal 0 0 0\n outer loop")?;
        for corner in triangle {
            let [x, y, z] = model.positions[*corner as usize];
            writeln!(out, "  vertex {x} {y} {z}")?;
        }
        writeln!(out, " endloop\nendfacet")?;
    }
    writeln!(out, "endsolid model")
}

fn xyz(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    model.positions.iter().try_for_each(|[x, y, z]| writeln!(out, "{x} {y} {z}"))
}

fn pcd(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    let count = model.positions.len();
    write!(
        out,
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA binary\n"
    )?;
    let values = model.positions.iter().flatten();
    values.map(|value| (*value as f32).to_le_bytes()).try_for_each(|bytes| out.write_all(&bytes))
}

/// Steps of a millionth of the largest coordinate.
fn e57(model: &Model, path: &Path) -> Result<(), Box<dyn Error>> {
    const STEPS: i64 = 1_000_000;
    let largest = model.positions.iter().flatten().fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()));
    let scale = largest / STEPS as f64;
    let mut file = E57Writer::from_file(path, "model")?;
    let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let records = axes.map(|name| {
        let data_type = RecordDataType::ScaledInteger { min: -STEPS, max: STEPS, scale, offset: 0.0 };
        Record { name, data_type }
    });
    let mut cloud = file.add_pointcloud("cloud", records.to_vec())?;
    for position in &model.positions {
        cloud.add_point(position.map(|value| RecordValue::ScaledInteger((value / scale).round() as i64)).to_vec())?;
    }
    cloud.finalize()?;
    file.finalize()?;
    Ok(())
}
