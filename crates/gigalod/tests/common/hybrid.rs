//! Hybrid files for tests: built from real scans and statues, and forged.

use gigalod::build::{NoProgress, Options, hybrid};
use gigalod::format::hybrid::{HybridFile, Model, NodeRecord, Page, Prepared, Skeleton, Statistics};
use gigalod::format::{Container, FileStore, Kind, MemoryStore, Metadata, Writer, checksum};
use gigalod::import::{ModelStream, read_all};
use gigalod::synth::{StatueOptions, write_statue};
use gigalod::verify::mesh_of;
use gigalod_reference::Mesh;
use std::fs::File;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A real model, or `None` (said so) where there are none.
pub(crate) fn scan(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("GIGALOD_DATA") else {
        println!("skipped: GIGALOD_DATA not set");
        return None;
    };
    let path = Path::new(&folder).join("scans").join(name);
    assert!(path.is_file(), "{} is missing", path.display());
    Some(path)
}

fn stream(path: &Path) -> Box<dyn ModelStream> {
    gigalod::import::open(Box::new(File::open(path).unwrap())).unwrap()
}

/// Builds a model in `folder`; the file, and the model.
pub(crate) fn built(path: &Path, options: &Options, folder: &Path) -> (HybridFile, Mesh) {
    let out = folder.join("model.glod");
    hybrid::build(stream(path), options, &NoProgress, &out).unwrap();
    let file = HybridFile::open(Container::open(Arc::new(FileStore::open(&out).unwrap())).unwrap()).unwrap();
    (file, mesh(path))
}

/// A whole model.
pub(crate) fn mesh(path: &Path) -> Mesh {
    mesh_of(read_all(&mut *stream(path), &mut |_, _| {}).unwrap()).unwrap()
}

/// Writes a small statue.
pub(crate) fn write(path: &Path, colors: bool) {
    let options = StatueOptions { triangles: 20_000, colors, ..StatueOptions::default() };
    write_statue(options, &mut File::create(path).unwrap(), &mut |_, _| {}).unwrap();
}

/// A small statue of a few levels.
pub(crate) fn statue(folder: &Path) -> (HybridFile, Mesh) {
    let path = folder.join("statue.ply");
    write(&path, false);
    built(&path, &Options { most_triangles: Some(1024), ..Options::default() }, folder)
}

/// A file in parts, to be put together again.
pub(crate) struct Forged {
    file: HybridFile,
    metadata: Metadata,
    pub(crate) records: Vec<NodeRecord>,
    pub(crate) pages: Vec<Page>,
}

impl Forged {
    pub(crate) fn of(file: &HybridFile) -> Self {
        let records = file.skeleton().nodes().to_vec();
        let pages =
            (0..records.len() as u32).map(|node| file.read_page(gigalod::format::hybrid::NodeId(node)).unwrap());
        Self {
            metadata: file.container().read_metadata().unwrap(),
            pages: pages.collect(),
            records,
            file: file.clone(),
        }
    }

    /// The fullest inner node below the root.
    pub(crate) fn inner(&self) -> usize {
        self.fullest(|record| record.level > 0 && record.children > 0)
    }

    /// The fullest node with a cone that leaves something out.
    pub(crate) fn with_cone(&self) -> usize {
        self.fullest(|record| record.cone_sine < 1.0 && record.triangles > 0)
    }

    fn fullest(&self, is_asked: impl Fn(&NodeRecord) -> bool) -> usize {
        let all = (0..self.records.len()).filter(|number| is_asked(&self.records[*number]));
        all.max_by_key(|number| self.records[*number].triangles).expect("there is one")
    }

    /// Removes vertices that no triangle uses.
    pub(crate) fn tidy(&mut self, node: usize) {
        let (page, record) = (&mut self.pages[node], &mut self.records[node]);
        let vertices = record.vertices as usize;
        let mut names = vec![None; vertices];
        let mut used = Vec::new();
        for corner in page.triangles.as_flattened_mut() {
            let name = names[*corner as usize].get_or_insert_with(|| {
                used.push(*corner as usize);
                used.len() as u32 - 1
            });
            *corner = *name;
        }
        used.extend(vertices..page.positions.len());
        page.positions = used.iter().map(|at| page.positions[*at]).collect();
        page.normals = used.iter().map(|at| page.normals[*at]).collect();
        if !page.colors.is_empty() {
            page.colors = used.iter().map(|at| page.colors[*at]).collect();
        }
        record.vertices = used.len() as u32 - record.points;
        record.triangles = page.triangles.len() as u32;
    }

    /// The file, with the right checksums.
    pub(crate) fn open(mut self) -> HybridFile {
        let root = *self.file.skeleton().root();
        let prepared: Vec<Prepared> = self
            .records
            .iter()
            .zip(&self.pages)
            .map(|(record, page)| Prepared::new(page, record.vertices, root.normal_bits))
            .collect();
        let mut statistics = Statistics::default();
        prepared.iter().for_each(|page| statistics.count(page));
        let model = Model::of(&statistics);
        let pages: Vec<Vec<u8>> = prepared.iter().map(|page| page.encode(&model)).collect();
        for ((record, page), prepared) in self.records.iter_mut().zip(&pages).zip(&prepared) {
            record.borders = prepared.page().borders.len() as u32;
            record.bytes = page.len() as u32;
            record.checksum = checksum(page);
        }
        let skeleton = Skeleton::encode(&root, &self.records, &model);
        let mut out = Cursor::new(Vec::new());
        let mut writer = Writer::new(&mut out, Kind::Hybrid, skeleton.len() as u64).unwrap();
        pages.iter().for_each(|page| writer.page(page).unwrap());
        writer.finish(&skeleton, &self.metadata).unwrap();
        let store = Arc::new(MemoryStore::new(out.into_inner()));
        HybridFile::open(Container::open(store).unwrap()).unwrap()
    }
}
