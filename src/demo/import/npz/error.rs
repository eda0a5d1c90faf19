//! The ways in which an archive, or an array in it, cannot be read.

use crate::demo::import::error::UnfoldError;

/// Errors of reading an archive.
#[derive(Debug, thiserror::Error)]
pub enum NpzError {
    /// There is no directory at its end.
    #[error("the archive has no directory")]
    NoDirectory,
    /// The directory does not list its members.
    #[error("the archive's directory is damaged")]
    DamagedDirectory,
    /// A member cannot be read.
    #[error("its array `{name}` {source}")]
    Member {
        /// The array's name.
        name: String,
        /// The fault in it.
        source: MemberError,
    },
}

/// Errors of a member of an archive; each message is what it does.
#[derive(Debug, thiserror::Error)]
pub enum MemberError {
    /// Its bytes are not in the file.
    #[error("lies outside the archive")]
    Outside,
    /// It is compressed in a way that is not read.
    #[error("is compressed with ZIP's method {0}; only stored and deflated are read")]
    Method(u16),
    /// Its compression is damaged, or a bomb.
    #[error("cannot be unpacked: {0}")]
    Unfold(#[from] UnfoldError),
    /// Its bytes are not those that were written.
    #[error("is damaged: its bytes do not have the archive's checksum")]
    Checksum,
    /// It does not begin as an array.
    #[error("is not an .npy array")]
    NotNpy,
    /// Its header does not tell its type.
    #[error("has no type")]
    NoType,
    /// Its header tells no shape.
    #[error("has no shape")]
    NoShape,
    /// Its numbers are in the other order.
    #[error("is in Fortran order; only C order is read")]
    FortranOrder,
    /// It has more numbers than are read.
    #[error("has the shape {0:?}, too large")]
    TooLarge(Vec<usize>),
    /// It holds something else than whole numbers of its type.
    #[error("holds `{0}`; numbers are needed")]
    NoNumbers(String),
    /// Its numbers do not fill its shape.
    #[error("has {found} numbers for the shape {shape:?}")]
    Shape {
        /// The count of its numbers.
        found: usize,
        /// The shape in its header.
        shape: Vec<usize>,
    },
}
