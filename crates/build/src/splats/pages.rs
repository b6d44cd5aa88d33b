//! Writes all pages: a model of how their symbols are distributed is made from a sample of them, then each is coded under it.

use super::layout::Layout;
use super::quantise::Quantised;
use crate::progress::Phases;
use gigalod_format::splats::codec::{self, Encoder, Model, Statistics};
use gigalod_format::splats::page::{CODEC_ENTROPY, CODEC_RAW};
use gigalod_format::splats::{PageContents, PageId, PageRecord, Skeleton};
use gigalod_format::{Kind, LevelSummary, Writer};
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufWriter};

pub(super) struct Written<'a> {
    pub(super) writer: Writer<BufWriter<&'a File>>,
    pub(super) pages: Vec<PageRecord>,
    pub(super) model: Option<Model>,
    pub(super) nodes: u64,
    pub(super) levels: Vec<LevelSummary>,
    /// All pages before entropy coding.
    pub(super) raw_bytes: u64,
}

/// Pages that are coded side by side.
const PAGES_AT_ONCE: usize = 32;

/// The model is made from about so many pages, spread over the file.
const SAMPLED_PAGES: usize = 96;

/// Writes all pages.
pub(super) fn write<'a>(quantised: &Quantised, file: &'a File, phases: &Phases<'_>) -> io::Result<Written<'a>> {
    let nodes = quantised.top.nodes.len() as u64 + quantised.nodes.len();
    phases.begin("pages", nodes);
    let layout = Layout::of(quantised)?;
    let mut records = layout.records.clone();
    let raw_bytes = raw_bytes(&layout, quantised);
    let model = model(&layout)?;
    // A small file's model may cost more than it saves.
    let model = (raw_bytes > 4 * model.to_bytes().len() as u64).then_some(model);

    phases.begin("write", nodes);
    let skeleton_bytes = Skeleton::encoded_bytes(records.len() as u64, model.as_ref());
    let mut writer = Writer::new(BufWriter::with_capacity(1 << 20, file), Kind::Splats, skeleton_bytes)?;
    let summary = |(level, (nodes, radius)): (usize, &(u64, f32))| LevelSummary {
        level: level as u32,
        nodes: *nodes,
        triangles: 0,
        points: *nodes,
        bytes: 0,
        // error_geo = (1 + k) times the radius; k = 1, round.
        max_error: 2.0 * f64::from(*radius),
    };
    let mut levels: Vec<LevelSummary> = quantised.levels.iter().enumerate().map(summary).collect();
    let encoder = model.as_ref().map(Encoder::new);
    let (mut number, mut done) = (0, 0);
    while number < records.len() {
        let batch = number..(number + PAGES_AT_ONCE).min(records.len());
        let coded = batch
            .clone()
            .into_par_iter()
            .map_init(
                || encoder.clone(),
                |encoder, page| Ok(code(&layout.page(PageId(page as u32))?, encoder.as_mut())),
            )
            .collect::<io::Result<Vec<_>>>()?;
        for (page, (codec, bytes)) in batch.zip(coded) {
            let record = &mut records[page];
            record.bytes = bytes.len() as u32;
            record.checksum = gigalod_format::checksum(&bytes);
            record.codec = codec;
            for (level, count) in &layout.levels[page] {
                levels[usize::from(*level)].bytes += bytes.len() as u64 * u64::from(*count) / u64::from(record.nodes);
            }
            done += u64::from(record.nodes);
            writer.page(&bytes)?;
            number += 1;
        }
        phases.at(done);
    }
    Ok(Written { writer, pages: records, model, nodes, levels, raw_bytes })
}

/// What all pages would take raw.
fn raw_bytes(layout: &Layout<'_>, quantised: &Quantised) -> u64 {
    let color_bytes = if quantised.top.colors.is_empty() { 0 } else { 2 };
    layout
        .records
        .iter()
        .zip(&layout.groups)
        .map(|(record, groups)| {
            let (nodes, families) = (u64::from(record.nodes), u64::from(record.families));
            let links = u64::from(record.words - record.nodes);
            nodes * (4 + color_bytes) + u64::from(*groups).div_ceil(4) + families.div_ceil(4) + links * 2
        })
        .sum()
}

fn model(layout: &Layout<'_>) -> io::Result<Model> {
    let step = (layout.records.len() / SAMPLED_PAGES).max(1);
    let sampled: Vec<usize> = (0..layout.records.len()).step_by(step).collect();
    let count = |mut statistics: Statistics, page: &usize| {
        codec::count(&layout.page(PageId(*page as u32))?, &mut statistics);
        Ok(statistics)
    };
    let statistics = sampled.par_iter().try_fold(Statistics::default, count).try_reduce(
        Statistics::default,
        |mut sum, statistics| {
            sum.add(&statistics);
            Ok::<_, io::Error>(sum)
        },
    )?;
    Ok(Model::of(&statistics))
}

/// A page by the codec that makes it smaller.
fn code(page: &PageContents, encoder: Option<&mut Encoder>) -> (u8, Vec<u8>) {
    let coded = encoder.map(|encoder| encoder.encode(page)).filter(|bytes| bytes.len() < page.raw_bytes());
    coded.map_or_else(|| (CODEC_RAW, page.encode()), |bytes| (CODEC_ENTROPY, bytes))
}
