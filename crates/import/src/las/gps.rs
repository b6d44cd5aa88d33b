//! GPS times of LAZ, version 2, which must be unpacked because what follows lies behind them in the same stream of bits.
//!
//! In: the decoder of a chunk. Out: the time of the next point, as the bits of an `f64`.
//!
//! The crate `laz` has the same, but it calls itself each time that the bits say "in another sequence", so that a hostile file
//! ends the program when the stack does. Here that is a loop, and one that ends. After LASzip 2.2 (M. Isenburg),
//! `LASreadItemCompressed_GPSTIME11_v2`.

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;
use std::io::{self, Read};

/// Sequences of times that interleave, as those of several scanners do.
const SEQUENCES: usize = 4;
/// Multiples of the last difference have symbols of their own, from −10 to 500: 0 to 500, then −1 to −10.
const MOST: i32 = 500;
const LEAST: i32 = -10;
/// Symbols behind those: the same time again; a time of its own; from there on, how many sequences further to look.
const UNCHANGED: i32 = MOST - LEAST + 1;
const WHOLE: i32 = MOST - LEAST + 2;
const SYMBOLS: u32 = (MOST - LEAST + 6) as u32;

pub(super) struct GpsTimes {
    /// Symbols after a difference, and after none.
    multiples: ArithmeticModel,
    beginnings: ArithmeticModel,
    integers: IntegerDecompressor,
    sequences: [Sequence; SEQUENCES],
    /// The sequence of the last point, and the one that was begun last.
    current: usize,
    newest: usize,
}

#[derive(Clone, Copy, Default)]
struct Sequence {
    time: i64,
    difference: i32,
    /// Times in a row whose difference is no small multiple of `difference`.
    misses: i32,
}

impl Default for GpsTimes {
    fn default() -> Self {
        Self {
            multiples: ArithmeticModelBuilder::new(SYMBOLS).build(),
            beginnings: ArithmeticModelBuilder::new(6).build(),
            integers: IntegerDecompressorBuilder::new().bits(32).contexts(9).build_initialized(),
            sequences: [Sequence::default(); SEQUENCES],
            current: 0,
            newest: 0,
        }
    }
}

impl Sequence {
    /// A difference that nothing foretold; after four of them, what is foretold follows.
    fn miss(&mut self, difference: i32) {
        self.misses += 1;
        if self.misses > 3 {
            (self.difference, self.misses) = (difference, 0);
        }
    }
}

/// What a symbol says.
enum Said {
    /// The time of this sequence is that of the point.
    Done,
    /// A new sequence begins.
    Whole,
    /// The point is in another sequence, so many further.
    Elsewhere(usize),
}

impl GpsTimes {
    /// Unpacks a symbol and what belongs to it.
    fn step<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<bool> {
        let said = self.symbol(decoder)?;
        match said {
            Said::Done => return Ok(true),
            Said::Elsewhere(further) => self.current = (self.current + further) % SEQUENCES,
            Said::Whole => {
                let upper = (self.sequences[self.current].time >> 32) as i32;
                let upper = self.integers.decompress(decoder, upper, 8)?;
                let time = i64::from(upper) << 32 | i64::from(decoder.read_int()?);
                self.newest = (self.newest + 1) % SEQUENCES;
                self.current = self.newest;
                self.sequences[self.current] = Sequence { time, ..Sequence::default() };
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn symbol<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Said> {
        let Self { multiples, beginnings, integers, sequences, current, .. } = self;
        let sequence = &mut sequences[*current];
        if sequence.difference == 0 {
            return Ok(match decoder.decode_symbol(beginnings)? {
                0 => Said::Done,
                1 => {
                    sequence.difference = integers.decompress(decoder, 0, 0)?;
                    sequence.time = sequence.time.wrapping_add(sequence.difference.into());
                    sequence.misses = 0;
                    Said::Done
                }
                2 => Said::Whole,
                symbol => Said::Elsewhere(symbol as usize - 2),
            });
        }
        let symbol = decoder.decode_symbol(multiples)? as i32;
        if symbol >= UNCHANGED {
            return Ok(match symbol {
                UNCHANGED => Said::Done,
                WHOLE => Said::Whole,
                _ => Said::Elsewhere((symbol - WHOLE) as usize),
            });
        }
        let multiple = if symbol > MOST { MOST - symbol } else { symbol };
        let context = match multiple {
            1 => 1,
            0 => 7,
            MOST => 4,
            LEAST => 6,
            2..10 => 2,
            10.. => 3,
            _ => 5,
        };
        let difference = integers.decompress(decoder, multiple.wrapping_mul(sequence.difference), context)?;
        match multiple {
            1 => sequence.misses = 0,
            0 | MOST | LEAST => sequence.miss(difference),
            _ => {}
        }
        sequence.time = sequence.time.wrapping_add(difference.into());
        Ok(Said::Done)
    }
}

impl<R: Read> FieldDecompressor<R> for GpsTimes {
    fn size_of_field(&self) -> usize {
        size_of::<i64>()
    }

    fn decompress_first(&mut self, source: &mut R, field: &mut [u8]) -> io::Result<()> {
        let mut bytes = [0; 8];
        source.read_exact(&mut bytes)?;
        field.copy_from_slice(&bytes);
        self.sequences[0].time = i64::from_le_bytes(bytes);
        Ok(())
    }

    fn decompress_with(&mut self, decoder: &mut ArithmeticDecoder<R>, field: &mut [u8]) -> io::Result<()> {
        // A writer looks for the right sequence once, and then says what the time is.
        for _ in 0..=SEQUENCES {
            if self.step(decoder)? {
                field.copy_from_slice(&self.sequences[self.current].time.to_le_bytes());
                return Ok(());
            }
        }
        Err(io::Error::new(io::ErrorKind::InvalidData, "times in ever other sequences"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use laz::las::v2;
    use laz::record::{
        RecordCompressor, RecordDecompressor, SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
    };
    use proptest::prelude::*;
    use std::io::Cursor;

    /// Packed by the crate.
    fn packed(times: &[i64]) -> Vec<u8> {
        let mut compressor = SequentialPointRecordCompressor::new(Cursor::new(Vec::new()));
        compressor.add_field_compressor(v2::GpsTimeCompressor::default());
        for time in times {
            compressor.compress_next(&time.to_le_bytes()).expect("memory takes all");
        }
        compressor.done().expect("memory takes all");
        compressor.into_inner().into_inner()
    }

    fn unpacked(
        bytes: &[u8],
        count: usize,
        field: impl FieldDecompressor<Cursor<Vec<u8>>> + Send + Sync + 'static,
    ) -> Vec<i64> {
        let mut decompressor = SequentialPointRecordDecompressor::new(Cursor::new(bytes.to_vec()));
        decompressor.add_field_decompressor(field);
        let mut time = [0; 8];
        (0..count)
            .map(|_| {
                decompressor.decompress_next(&mut time).expect("it is sound");
                i64::from_le_bytes(time)
            })
            .collect()
    }

    proptest! {
        #[test]
        fn times_come_back(steps in prop::collection::vec((0usize..6, 0usize..8, -20i64..600, any::<i32>()), 1..400)) {
            // Of scanners that interleave, each with its own step, and now and then a jump.
            let mut clocks = [1i64 << 40, 5 << 50, -(3 << 45), 77, 1 << 60, 1 << 55];
            let times: Vec<i64> = steps
                .iter()
                .map(|&(clock, kind, multiple, jump)| {
                    clocks[clock] += match kind {
                        0 => 0,
                        1..5 => 1000 * (1 + clock as i64),
                        5 | 6 => 1000 * (1 + clock as i64) * multiple + i64::from(jump % 5),
                        _ => i64::from(jump) << 20,
                    };
                    clocks[clock]
                })
                .collect();
            let bytes = packed(&times);
            prop_assert_eq!(&unpacked(&bytes, times.len(), GpsTimes::default()), &times);
            prop_assert_eq!(unpacked(&bytes, times.len(), v2::GpsTimeDecompressor::default()), times);
        }
    }

    /// The crate's own way takes the stack for each time that the bits say "elsewhere".
    #[test]
    fn bits_that_never_come_to_an_end_are_an_error() {
        let mut found = 0;
        for seed in 0..2000u64 {
            let mut state = seed;
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 56) as u8
            };
            let bytes: Vec<u8> = (0..200).map(|_| random()).collect();
            let mut decompressor = SequentialPointRecordDecompressor::new(Cursor::new(bytes));
            decompressor.add_field_decompressor(GpsTimes::default());
            let end = (0..100_000).find_map(|_| decompressor.decompress_next(&mut [0; 8]).err());
            found += usize::from(end.is_some_and(|error| error.kind() == io::ErrorKind::InvalidData));
        }
        assert!(found > 0, "some of them say so five times in a row");
    }
}
