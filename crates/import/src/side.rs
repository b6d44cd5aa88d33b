//! Files that a model names: materials, pictures, buffers.
//!
//! In: a name, as it is in the model. Out: the bytes. This crate opens no file; who opened the model knows where it lies.

use crate::ByteSource;
use std::io;

/// Opens files by the names that a model has for them. Any function from a name to its bytes is one.
///
/// Names are untrusted: whoever implements this decides what a model may read.
pub trait SideFiles: Send {
    /// The file called `name`, relative to the model.
    ///
    /// # Errors
    /// There is none, or it may not be read.
    fn open(&mut self, name: &str) -> io::Result<Box<dyn ByteSource>>;
}

impl<F: FnMut(&str) -> io::Result<Box<dyn ByteSource>> + Send> SideFiles for F {
    fn open(&mut self, name: &str) -> io::Result<Box<dyn ByteSource>> {
        self(name)
    }
}

/// No side file can be had: for a model whose surroundings are unknown.
pub struct NoSideFiles;

impl SideFiles for NoSideFiles {
    fn open(&mut self, _name: &str) -> io::Result<Box<dyn ByteSource>> {
        Err(io::Error::new(io::ErrorKind::NotFound, "no files beside the model can be had here"))
    }
}
