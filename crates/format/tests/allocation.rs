//! Files that claim to be enormous: opening one allocates no more than the format's limits. Alone in its program, because
//! the allocator counts for all threads.

#[path = "../../gigalod/tests/counting/mod.rs"]
mod counting;

use counting::peak_of;
use gigalod_format::hybrid::{HybridFile, Model, NodeId};
use gigalod_format::splats::{PageId, SplatFile};
use gigalod_format::{Container, PageStore, checksum};
use std::io;
use std::sync::Arc;

/// A sparse file: some bytes, then zeros as far as one likes.
struct Sparse {
    head: Vec<u8>,
    bytes: u64,
}

impl PageStore for Sparse {
    fn len(&self) -> u64 {
        self.bytes
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        for (at, byte) in (offset..).zip(buffer) {
            *byte = self.head.get(at as usize).copied().unwrap_or(0);
        }
        Ok(())
    }

    fn bytes_read(&self) -> u64 {
        0
    }
}

/// A header with these sections, then `rest`.
fn sparse(bytes: u64, skeleton: (u64, &[u8]), metadata_bytes: u64) -> Arc<Sparse> {
    sparse_of(1, bytes, skeleton, metadata_bytes)
}

/// The same of some kind.
fn sparse_of(kind: u32, bytes: u64, skeleton: (u64, &[u8]), metadata_bytes: u64) -> Arc<Sparse> {
    let mut head = b"\x89GLOD\r\n\x1a\x01\0\0\0".to_vec();
    head.extend(kind.to_le_bytes());
    for field in [0, bytes, 128, skeleton.0] {
        head.extend(u64::to_le_bytes(field));
    }
    head.extend(checksum(skeleton.1).to_le_bytes());
    head.extend(0u32.to_le_bytes());
    for field in [4096, metadata_bytes, 8192] {
        head.extend(u64::to_le_bytes(field));
    }
    head.resize(124, 0);
    head.extend(checksum(&head).to_le_bytes());
    head.extend(skeleton.1);
    Arc::new(Sparse { head, bytes })
}

#[test]
fn claims_of_enormous_sections_allocate_next_to_nothing() {
    const HUGE: u64 = 1 << 62;
    let store = sparse(HUGE, (HUGE / 2, &[]), HUGE / 2);
    let (found, peak) = peak_of(|| {
        let container = Container::open(store).unwrap();
        let metadata = container.read_metadata().unwrap_err().to_string();
        (metadata, SplatFile::open(container).unwrap_err().to_string())
    });
    assert_eq!(found.0, format!("the metadata: {} bytes, expected at most 16777216", HUGE / 2));
    assert_eq!(found.1, format!("the skeleton: {} bytes, expected at most 268435456", HUGE / 2));
    assert!(peak < 4096, "{peak} bytes");

    // A skeleton that is all right but for its number of pages, and the largest page a record can claim.
    let mut skeleton = vec![0; 144];
    skeleton[40..44].copy_from_slice(&1f32.to_le_bytes());
    skeleton[92..100].copy_from_slice(&8192u64.to_le_bytes());
    skeleton[100..108].copy_from_slice(&1u64.to_le_bytes());
    skeleton[116..120].copy_from_slice(&1u32.to_le_bytes());
    for pages in [1u64, 1 << 40, u64::MAX] {
        skeleton[108..116].copy_from_slice(&pages.to_le_bytes());
        skeleton[128..132].copy_from_slice(&(104 + 9 * 8192u32).to_le_bytes());
        skeleton[136..142].copy_from_slice(&[0, 0x20, 0, 0x40, 0, 0x10]);
        // CRC-32C of the zeros that the page consists of.
        skeleton[132..136].copy_from_slice(&checksum(&vec![0; 104 + 9 * 8192]).to_le_bytes());
        let store = sparse(HUGE, (144, &skeleton), 0);
        let (found, peak) = peak_of(|| {
            let file = SplatFile::open(Container::open(store).unwrap());
            file.and_then(|file| file.read_page(PageId(0)).map(|_| ())).unwrap_err().to_string()
        });
        if pages == 1 {
            assert_eq!(found, "page 0: 73828 bytes for 8192 nodes in 0 groups with 0 runs, expected 50176");
        } else {
            assert_eq!(found, format!("the skeleton: {pages} pages in 144 bytes of skeleton"));
        }
        assert!(peak < 80 << 10, "{peak} bytes");
    }

    // A hybrid file of one node that claims the most there may be, in as few bytes as that takes.
    let model = Model::default().to_bytes();
    let mut skeleton = vec![0; 156];
    skeleton[24..32].copy_from_slice(&1f64.to_le_bytes());
    skeleton[80..97].copy_from_slice(&[1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1]);
    skeleton[100..105].copy_from_slice(&[10, 9, 2, 0, 1]);
    skeleton[108..112].copy_from_slice(&(model.len() as u32).to_le_bytes());
    skeleton[136..145].copy_from_slice(&[0, 0, 0x10, 0, 0, 0x40, 0, 0, 0x10]);
    let page_bytes = (6u32 << 20) / 256;
    skeleton[148..152].copy_from_slice(&page_bytes.to_le_bytes());
    skeleton[152..156].copy_from_slice(&checksum(&vec![0; page_bytes as usize]).to_le_bytes());
    skeleton.extend(model);
    let store = sparse_of(2, HUGE, (skeleton.len() as u64, &skeleton), 0);
    let (found, peak) = peak_of(|| {
        let file = HybridFile::open(Container::open(store).unwrap()).unwrap();
        file.read_page(NodeId(0)).unwrap_err().to_string()
    });
    assert_eq!(found, "page 0: its code makes no sense");
    assert!(peak < 8 << 20, "{peak} bytes");
}
