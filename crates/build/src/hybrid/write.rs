//! Writes the file: nodes level by level, each page coded under a model that is made from a sample of them.

use super::Shape;
use super::nodes::{Entry, Nodes};
use crate::progress::Phases;
use gigalod_format::hybrid::{Model, Prepared, Statistics};
use gigalod_format::hybrid::{NodeRecord, Skeleton};
use gigalod_format::{Kind, LevelSummary, Writer, checksum};
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufWriter};

pub(super) struct Written<'a> {
    pub(super) writer: Writer<BufWriter<&'a File>>,
    pub(super) records: Vec<NodeRecord>,
    pub(super) model: Model,
    pub(super) levels: Vec<LevelSummary>,
    pub(super) leaves: u64,
    /// All pages before entropy coding.
    pub(super) raw_bytes: u64,
}

/// Pages that are coded side by side.
const PAGES_AT_ONCE: usize = 32;
/// The model is made from about so many pages, spread over the file.
const SAMPLED_PAGES: usize = 400;

/// Writes all pages.
pub(super) fn write<'a>(
    nodes: &mut Nodes,
    shape: &Shape,
    file: &'a File,
    phases: &Phases<'_>,
) -> io::Result<Written<'a>> {
    phases.begin("write", nodes.list.len() as u64);
    nodes.list.sort_unstable_by_key(Entry::cell);
    let mut records: Vec<NodeRecord> = nodes.list.iter().map(Entry::record).collect();
    let leaves = link(&nodes.list, &mut records);

    let every = nodes.list.len().div_ceil(SAMPLED_PAGES);
    let sample: Vec<&Entry> = nodes.list.iter().step_by(every).collect();
    let count = |entry: &&Entry| -> io::Result<Statistics> {
        let mut statistics = Statistics::default();
        statistics.count(&prepare(nodes, entry, shape)?);
        Ok(statistics)
    };
    let counted: Vec<Statistics> = sample.par_iter().map(count).collect::<io::Result<_>>()?;
    let mut statistics = Statistics::default();
    counted.iter().for_each(|counted| statistics.add(counted));
    let model = Model::of(&statistics);

    let skeleton_bytes = Skeleton::encoded_bytes(records.len() as u64, &model);
    let mut writer = Writer::new(BufWriter::with_capacity(1 << 20, file), Kind::Hybrid, skeleton_bytes)?;
    let mut raw_bytes = skeleton_bytes;
    for first in (0..records.len()).step_by(PAGES_AT_ONCE) {
        let batch = &nodes.list[first..(first + PAGES_AT_ONCE).min(records.len())];
        let coded = batch.par_iter().map(|entry| -> io::Result<_> {
            let prepared = prepare(nodes, entry, shape)?;
            let page = prepared.page();
            let raw = page.positions.len() * 10 + page.colors.len() * 3 + page.triangles.len() * 6;
            Ok((prepared.encode(&model), page.borders.len() as u32, raw as u64))
        });
        let coded: Vec<_> = coded.collect::<io::Result<_>>()?;
        for (record, (bytes, borders, raw)) in records[first..].iter_mut().zip(coded) {
            record.borders = borders;
            record.bytes = bytes.len() as u32;
            record.checksum = checksum(&bytes);
            raw_bytes += raw;
            writer.page(&bytes)?;
        }
        phases.at((first + batch.len()) as u64);
    }
    let levels = summaries(&records);
    Ok(Written { writer, records, model, levels, leaves, raw_bytes })
}

fn prepare(nodes: &Nodes, entry: &Entry, shape: &Shape) -> io::Result<Prepared> {
    Ok(Prepared::new(&nodes.page(entry, shape.has_colors)?, entry.vertices, shape.normal_bits))
}

/// Tells parents their children, and lets no error rise towards the leaves; returns the number of leaves.
fn link(list: &[Entry], records: &mut [NodeRecord]) -> u64 {
    let mut parent = 0;
    for child in 1..list.len() {
        while list[parent].cell() != list[child].cell().parent() {
            parent += 1;
        }
        let record = &mut records[parent];
        if record.children == 0 {
            record.first_child = child as u32;
        }
        record.children += 1;
    }
    for number in (0..list.len()).rev() {
        let NodeRecord { first_child, children, .. } = records[number];
        let below = &records[first_child as usize..(first_child + children) as usize];
        let most = below.iter().fold(0.0f32, |most, child| most.max(child.error_total));
        records[number].error_total = records[number].error_total.max(most);
    }
    let mut next = 1;
    for record in records.iter_mut() {
        // Of a leaf too: where its children would be.
        record.first_child = next;
        next += record.children;
    }
    records.iter().filter(|record| record.children == 0).count() as u64
}

fn summaries(records: &[NodeRecord]) -> Vec<LevelSummary> {
    let mut levels: Vec<LevelSummary> = Vec::new();
    for record in records {
        if record.level as usize == levels.len() {
            let level = record.level;
            levels.push(LevelSummary { level, nodes: 0, triangles: 0, points: 0, bytes: 0, max_error: 0.0 });
        }
        let level = &mut levels[record.level as usize];
        level.nodes += 1;
        level.triangles += u64::from(record.triangles);
        level.points += u64::from(record.points);
        level.bytes += u64::from(record.bytes);
        level.max_error = level.max_error.max(f64::from(record.as_stored().error_geo));
    }
    levels
}
