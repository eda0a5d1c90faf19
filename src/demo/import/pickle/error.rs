//! The ways in which a pickle is damaged, or more than plain data and arrays.

use super::{super::MAX_UNFOLDED, Global, machine::MAX_INSTRUCTIONS};

/// Errors of reading a pickle.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PickleError {
    /// The bytes are used up.
    #[error("the pickle ends too early")]
    Ended,
    /// It is longer than what is followed.
    #[error("the pickle has more than {MAX_INSTRUCTIONS} instructions")]
    TooLong,
    /// It makes more bytes of texts than are kept.
    #[error("the pickle encodes texts of more than {} MiB", MAX_UNFOLDED >> 20)]
    TooMuchText,
    /// It is of a later kind than is known.
    #[error("the pickle has the unknown protocol {0}")]
    Protocol(u8),
    /// An instruction is unknown, or runs code.
    #[error("the pickle uses the instruction 0x{0:02x}, which plain data and arrays do not need")]
    Instruction(u8),
    /// A function or class is none of numpy's that make arrays.
    #[error("the pickle names `{module}.{name}`; numpy's array, scalar and dtype alone are known")]
    UnknownFunction {
        /// The module that it is of.
        module: String,
        /// Its name.
        name: String,
    },
    /// A known function has other arguments than numpy gives it.
    #[error("the pickle calls {0:?} in a way that numpy does not")]
    Call(Global),
    /// An array or type gets another state than numpy gives it.
    #[error("the pickle builds an object in a way that numpy does not")]
    Build,
    /// The stack has no object, or no mark, where one is needed.
    #[error("the pickle takes from an empty stack")]
    EmptyStack,
    /// An object was never kept.
    #[error("the pickle recalls {0}, which it never made")]
    NeverMade(u64),
    /// An object is of another kind than an instruction needs.
    #[error("the pickle {action} something that is not {needed}")]
    WrongObject {
        /// The instruction's effect, as a verb.
        action: &'static str,
        /// The kind of object that it needs.
        needed: &'static str,
    },
    /// A dictionary gets a key alone.
    #[error("the pickle has a key without a value")]
    KeyAlone,
    /// A whole number is too large.
    #[error("the pickle has a whole number beyond 64 bits")]
    LongNumber,
    /// Bytes are no text, or text no bytes, in the encoding.
    #[error("the pickle has text that is not {0}")]
    Encoding(&'static str),
}
