//! Random numbers: one seed a run, one independent stream a purpose.
//!
//! Owns [`Seed`] and [`Stream`] over ChaCha8, whose state can be saved. Knows nothing of what the
//! numbers are for. There is no global generator: whoever draws is handed a [`Rng`], so that what
//! one part draws never moves another.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use serde::{Deserialize, Serialize};

/// The one generator of this crate; saved and restored with serde.
pub type Rng = ChaCha8Rng;

/// The purpose of a stream of random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Stream {
    /// Initial weights of the networks.
    Network = 1,
    /// Initial states of the training environments; the index is the environment's.
    Environment = 2,
    /// Noise of the actions while training; the index is the environment's.
    Action = 3,
    /// Order of the samples in minibatches, and whatever else an update draws.
    Update = 4,
    /// Initial states of evaluation episodes; the index is the evaluation's.
    Evaluation = 5,
    /// Pre-training.
    Pretraining = 6,
    /// Resampling in statistics.
    Bootstrap = 7,
}

/// The seed of a run.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    schemars::JsonSchema,
)]
#[serde(transparent)]
pub struct Seed(pub u64);

impl Seed {
    /// The generator for `stream`; two different pairs (stream, index) give independent numbers
    /// under the same seed.
    pub fn stream(self, stream: Stream, index: u32) -> Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.0);
        rng.set_stream((stream as u64) << 32 | u64::from(index));
        rng
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng as _;

    #[test]
    fn streams_and_indices_differ_and_repeat() {
        let first = |stream, index| Seed(7).stream(stream, index).next_u64();
        assert_eq!(first(Stream::Action, 0), first(Stream::Action, 0));
        assert_ne!(first(Stream::Action, 0), first(Stream::Action, 1));
        assert_ne!(first(Stream::Action, 0), first(Stream::Environment, 0));
        assert_ne!(
            first(Stream::Action, 0),
            Seed(8).stream(Stream::Action, 0).next_u64()
        );
    }

    #[test]
    fn a_saved_generator_goes_on_where_it_was() {
        let mut rng = Seed(1).stream(Stream::Update, 0);
        rng.next_u32();
        let saved = postcard::to_stdvec(&rng).expect("a generator serialises");
        let mut restored: Rng = postcard::from_bytes(&saved).expect("and comes back");
        assert_eq!(rng.next_u64(), restored.next_u64());
    }
}
