//! `.npz`: numpy arrays in a ZIP archive.
//!
//! Members stored or deflated, found by the archive's directory; arrays of numbers or truth values
//! in C order. Members that nobody asks for (`infos` of `imitation`, which is a pickle) are not
//! looked into.

mod error;

pub use error::{MemberError, NpzError};

use super::{
    ImportError, Imported, MAX_NUMBERS,
    arrays::{Array, decode},
    assemble::assemble,
    unfold,
};
use crate::env::EnvId;

/// The demonstration of `env` in the archive `file`.
pub(super) fn read(file: &[u8], env: EnvId) -> Result<Imported, ImportError> {
    let members = directory(file)?;
    let names: Vec<&str> = members
        .iter()
        .map(|(name, _)| name.trim_end_matches(".npy"))
        .collect();
    let imported = assemble(env, names.iter().copied(), &|name| {
        let Some((_, member)) = members
            .iter()
            .find(|(found, _)| found.strip_suffix(".npy") == Some(name))
        else {
            return Ok(None);
        };
        let array = unfolded(file, *member).and_then(|bytes| array(&bytes));
        let of_member = |source| NpzError::Member {
            name: name.to_owned(),
            source,
        };
        Ok(Some(array.map_err(of_member)?))
    });
    imported.map_err(|source| ImportError::ArchivedArrays {
        source,
        members: names.into_iter().map(str::to_owned).collect(),
    })
}

/// A member of the archive.
#[derive(Debug, Clone, Copy)]
struct Member {
    method: u16,
    compressed_size: usize,
    /// The offset of its own header.
    offset: usize,
    /// The CRC-32 of its bytes, decompressed.
    checksum: usize,
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?) as usize)
}

/// The members by name, from the directory at the archive's end.
fn directory(file: &[u8]) -> Result<Vec<(String, Member)>, NpzError> {
    const END: &[u8] = b"PK\x05\x06";
    const ENTRY: &[u8] = b"PK\x01\x02";
    // A comment of up to 64 KiB may follow the directory.
    let tail = file.len().saturating_sub(22 + (1 << 16));
    let end = file[tail..]
        .windows(4)
        .rposition(|window| window == END)
        .ok_or(NpzError::NoDirectory)?
        + tail;
    let damaged = || NpzError::DamagedDirectory;
    let comment = u16_at(file, end + 20)
        .map(usize::from)
        .ok_or_else(damaged)?;
    if file.len() < end + 22 + comment {
        return Err(damaged());
    }
    let count = u16_at(file, end + 10).ok_or_else(damaged)?;
    let mut at = u32_at(file, end + 16).ok_or_else(damaged)?;
    let mut members = Vec::new();
    for _ in 0..count {
        let entry = file
            .get(at..)
            .filter(|entry| entry.starts_with(ENTRY))
            .ok_or_else(damaged)?;
        let member = || {
            let lengths =
                [u16_at(entry, 28)?, u16_at(entry, 30)?, u16_at(entry, 32)?].map(usize::from);
            let name = String::from_utf8_lossy(entry.get(46..46 + lengths[0])?).into_owned();
            let (method, checksum) = (u16_at(entry, 10)?, u32_at(entry, 16)?);
            let (compressed_size, offset) = (u32_at(entry, 20)?, u32_at(entry, 42)?);
            Some((
                name,
                Member {
                    method,
                    compressed_size,
                    offset,
                    checksum,
                },
                46 + lengths.iter().sum::<usize>(),
            ))
        };
        let (name, member, length) = member().ok_or_else(damaged)?;
        members.push((name, member));
        at += length;
    }
    Ok(members)
}

/// The bytes of `member`, decompressed.
fn unfolded(file: &[u8], member: Member) -> Result<Vec<u8>, MemberError> {
    let stored = || {
        let header = file
            .get(member.offset..)
            .filter(|header| header.starts_with(b"PK\x03\x04"))?;
        let start = 30 + usize::from(u16_at(header, 26)?) + usize::from(u16_at(header, 28)?);
        header.get(start..)?.get(..member.compressed_size)
    };
    let stored = stored().ok_or(MemberError::Outside)?;
    let bytes = match member.method {
        0 => unfold(stored)?,
        8 => unfold(flate2::read::DeflateDecoder::new(stored))?,
        other => return Err(MemberError::Method(other)),
    };
    let mut crc = flate2::Crc::new();
    crc.update(&bytes);
    if crc.sum() as usize == member.checksum {
        Ok(bytes)
    } else {
        Err(MemberError::Checksum)
    }
}

/// The array in `bytes`, an `.npy` file.
fn array(bytes: &[u8]) -> Result<Array, MemberError> {
    let split = || {
        let (major, rest) = bytes.strip_prefix(b"\x93NUMPY")?.split_first()?;
        let rest = rest.get(1..)?;
        let (length, rest) = match major {
            1 => (usize::from(u16_at(rest, 0)?), rest.get(2..)?),
            2 | 3 => (u32_at(rest, 0)?, rest.get(4..)?),
            _ => return None,
        };
        let (header, data) = rest.split_at_checked(length)?;
        Some((std::str::from_utf8(header).ok()?, data))
    };
    let (header, data) = split().ok_or(MemberError::NotNpy)?;
    // The header is Python's: {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }
    let after = |key: &str| {
        header
            .split_once(key)
            .map(|(_, rest)| rest.trim_start_matches([':', ' ', '\'']))
    };
    let dtype = after("'descr'")
        .and_then(|rest| rest.split('\'').next())
        .ok_or(MemberError::NoType)?;
    let fortran = after("'fortran_order'").is_some_and(|rest| rest.starts_with("True"));
    let shape = after("'shape'")
        .and_then(|rest| rest.strip_prefix('(')?.split_once(')'))
        .ok_or(MemberError::NoShape)?
        .0;
    let shape = shape
        .split(',')
        .map(str::trim)
        .filter(|length| !length.is_empty());
    let shape: Vec<usize> = shape
        .map(|n| n.parse().map_err(|_| MemberError::NoShape))
        .collect::<Result<_, _>>()?;
    // A vector is the same in both orders.
    if fortran && shape.len() > 1 {
        return Err(MemberError::FortranOrder);
    }
    let size = shape
        .iter()
        .try_fold(1usize, |size, &length| size.checked_mul(length));
    let size = size
        .filter(|&size| size <= MAX_NUMBERS)
        .ok_or_else(|| MemberError::TooLarge(shape.clone()))?;
    let numbers = decode(
        dtype.trim_start_matches(['<', '>', '=', '|']),
        !dtype.starts_with('>'),
        data,
    );
    let numbers = numbers.ok_or_else(|| MemberError::NoNumbers(dtype.to_owned()))?;
    if size != numbers.len() {
        return Err(MemberError::Shape {
            found: numbers.len(),
            shape,
        });
    }
    Ok(Array::new(shape.first().copied().unwrap_or(1), numbers))
}
