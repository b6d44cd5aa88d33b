//! What a work folder says about the build in it: whose it is, and how far it has come.
//!
//! In: a [`Journal`]. Out: its bytes, with a checksum; or a journal of bytes that are whole. Spools that it names are on disk.

use crate::InputIdentity;
use crate::input::SideFile;
use crate::unfinished::SPOOL_SUFFIX;
use gigalod_format::checksum;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Whose build it is: two with the same header have the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Header {
    /// Name and version of the program.
    pub(crate) program: String,
    pub(crate) input: InputIdentity,
    /// Those that the bytes depend on.
    pub(crate) options: BTreeMap<String, String>,
}

/// How far a build has come.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Journal {
    pub(crate) header: Header,
    /// Files that the input names; what is not to be asked for again is in the spools.
    pub(crate) side: Vec<SideFile>,
    /// The last that is finished.
    pub(crate) phase: String,
    /// What the next phase needs, by name.
    pub(crate) spools: BTreeMap<String, Extent>,
    /// What else it needs.
    pub(crate) state: Value,
}

/// The part of a spool's file that counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Extent {
    pub(crate) records: u64,
    pub(crate) record_bytes: u64,
    /// CRC-32C of these bytes.
    pub(crate) checksum: u32,
}

/// First word of each journal; the number changes with the meaning of journals or spools.
const MAGIC: &str = "gigalod-build-journal-4";

impl Journal {
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let body = serde_json::to_string(self).expect("journals are plain data");
        format!("{MAGIC} {:08x}\n{body}\n", checksum(body.as_bytes())).into_bytes()
    }

    /// None where it is damaged, or of another version.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        let (first, body) = std::str::from_utf8(bytes).ok()?.split_once('\n')?;
        let body = body.strip_suffix('\n')?;
        let is_sound = first == format!("{MAGIC} {:08x}", checksum(body.as_bytes()));
        is_sound.then(|| serde_json::from_str(body).ok())?
    }
}

impl Journal {
    /// A file of the folder that a build cannot go on without.
    pub(crate) fn needs(&self, name: &str) -> bool {
        name == "journal" || name.strip_suffix(SPOOL_SUFFIX).is_some_and(|spool| self.spools.contains_key(spool))
    }
}

impl Header {
    /// What differs, as this one has it and as the other has.
    pub(crate) fn difference(&self, other: &Self) -> Option<(&'static str, String, String)> {
        if let Some((own, others)) = self.input.difference(&other.input) {
            return Some(("of another input", own, others));
        }
        if self.program != other.program {
            return Some(("by another version of the program", self.program.clone(), other.program.clone()));
        }
        let words = |header: &Self| {
            header.options.iter().map(|(name, value)| format!("--{name} {value}")).collect::<Vec<_>>().join(" ")
        };
        (self.options != other.options).then(|| ("with other options", words(self), words(other)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FileIdentity;
    use std::path::Path;

    fn journal() -> Journal {
        let file = |path: &str| FileIdentity { path: path.into(), bytes: 7, modified: (1, 2), ends: [3, 4] };
        let input = InputIdentity { files: vec![file("/a"), file("/b")] };
        let header = Header { program: "gigalod".into(), input, options: BTreeMap::from([("up".into(), "y".into())]) };
        let spools = BTreeMap::from([("leaves".into(), Extent { records: 5, record_bytes: 20, checksum: 7 })]);
        let state = serde_json::json!({ "origin": [0.1, 1e-300, f64::MAX] });
        let side = vec![SideFile::now(Path::new("/nowhere/to be found"))];
        Journal { header, side, phase: "leaves".into(), spools, state }
    }

    #[test]
    fn a_journal_comes_back_as_it_was_and_a_damaged_one_not_at_all() {
        let bytes = journal().to_bytes();
        let back = Journal::of(&bytes).unwrap();
        assert_eq!(back.to_bytes(), bytes);
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1;
            assert!(Journal::of(&damaged).is_none() && Journal::of(&bytes[..at]).is_none(), "byte {at}");
        }
    }

    #[test]
    fn what_differs_is_named_with_both_sides() {
        let ours = journal().header;
        assert_eq!(ours.difference(&ours), None);
        let mut other = ours.clone();
        other.options.insert("up".into(), "z".into());
        assert_eq!(ours.difference(&other), Some(("with other options", "--up y".into(), "--up z".into())));
        other.input.files[1].bytes = 8;
        assert_eq!(ours.difference(&other), Some(("of another input", "7 bytes".into(), "8 bytes".into())));
        other.input.files.pop();
        assert_eq!(ours.difference(&other), Some(("of another input", "2 files".into(), "1 files".into())));
        other.input.files[0].path = "/c".into();
        assert_eq!(ours.difference(&other), Some(("of another input", "/a".into(), "/c".into())));
    }
}
