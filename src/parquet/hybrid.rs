//! Small numbers, such as levels and places in a dictionary, as Parquet packs them.

use super::{
    error::{PageError, ThriftError},
    thrift::Reader,
};

/// `n` numbers of `width` bits in Parquet's mixture of runs and packed groups of eight.
pub(super) fn hybrid(bytes: &[u8], width: u32, n: usize) -> Result<Vec<u32>, PageError> {
    if width > 32 {
        return Err(PageError::Width(width));
    }
    let mut reader = Reader { rest: bytes };
    let mut numbers = Vec::with_capacity(n);
    if width == 0 {
        numbers.resize(n, 0);
    }
    while numbers.len() < n {
        let header = reader.varint()?;
        let left = n - numbers.len();
        if header & 1 == 0 {
            let mut word = [0; 4];
            let stored = reader.take(width.div_ceil(8) as usize)?;
            word[..stored.len()].copy_from_slice(stored);
            let run = usize::try_from(header >> 1).map_or(left, |run| run.min(left));
            numbers.resize(numbers.len() + run, u32::from_le_bytes(word));
        } else {
            let packed = usize::try_from(header >> 1)
                .map_or(left, |groups| groups.saturating_mul(8).min(left));
            // The last group may be cut off where no number is left.
            let stored = (header >> 1)
                .saturating_mul(u64::from(width))
                .min(reader.rest.len() as u64);
            let stored = reader.take(stored as usize)?;
            if (stored.len() as u64) * 8 < packed as u64 * u64::from(width) {
                return Err(ThriftError::Ended.into());
            }
            numbers.extend((0..packed as u64).map(|i| bits(stored, i * u64::from(width), width)));
        }
    }
    Ok(numbers)
}

/// The `width` bits of `bytes` from bit `start` on, which must exist.
fn bits(bytes: &[u8], start: u64, width: u32) -> u32 {
    let first = (start / 8) as usize;
    let last = bytes.len().min(first + 5);
    let word = bytes[first..last]
        .iter()
        .rev()
        .fold(0u64, |word, &byte| word << 8 | u64::from(byte));
    (word >> (start % 8) & ((1u64 << width) - 1)) as u32
}
