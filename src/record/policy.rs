//! Policies as safetensors, readable from Python:
//! `safetensors.numpy.load_file("policy.safetensors")`.
//!
//! `policy.mean.<layer>.weight` `[out, in]` and `.bias` `[out]`, `policy.log_std` `[action_dim]`,
//! `value.<layer>.weight` and `.bias`, `normalizer.mean`, `.std` and `.deviations`
//! `[observation_dim]`, `.count` and `.clip` `[1]`. A layer's output is `weight @ input + bias`,
//! then tanh except after the last one; the input is `clip((observation - mean) / (std + 1e-8),
//! -clip, clip)`.

mod error;

use std::{collections::HashMap, path::Path};

use safetensors::{Dtype, SafeTensorError, SafeTensors, tensor::TensorView};
use serde::{Deserialize, Serialize};

pub use error::PolicyError;

use super::{RecordError, Stamp, read_bounded, write_atomically};
use crate::{
    algo::Agent,
    env::Spaces,
    nn::{GaussianPolicy, Mlp, Normalizer},
    rng::{Seed, Stream},
};

/// The largest file that is read, bytes.
const LIMIT: u64 = 1 << 30;

/// Writes `agent`. The bytes depend on the agent and the run alone, not on when or how the program
/// was called.
///
/// # Errors
///
/// The disk refuses, or a parameter is not finite.
pub fn write(path: &Path, agent: &Agent, stamp: &Stamp) -> Result<(), RecordError> {
    let bytes = encode(agent, stamp).map_err(|error| malformed(path, error))?;
    write_atomically(path, &bytes)
}

/// Reads a policy and the stamp of the run that it comes from.
///
/// # Errors
///
/// There is no such file, it is damaged, its shapes do not fit together, or a number is not finite.
pub fn read(path: &Path) -> Result<(Agent, Stamp), RecordError> {
    decode(&bytes(path)?).map_err(|error| malformed(path, error))
}

/// As [`read`], for a policy that must act within `spaces`.
///
/// # Errors
///
/// As for [`read`], or its observations or actions have other dimensions.
pub fn read_for(path: &Path, spaces: Spaces) -> Result<(Agent, Stamp), RecordError> {
    let (agent, stamp) = read(path)?;
    let found = (agent.normalizer.mean().len(), agent.policy.log_std().len());
    let needed = (spaces.observation_dim, spaces.action_dim);
    if found != needed {
        return Err(malformed(path, PolicyError::Dimensions { found, needed }));
    }
    Ok((agent, stamp))
}

/// The BLAKE3 digest of the numbers in a policy's file, without its metadata.
///
/// # Errors
///
/// There is no such file, or it is damaged.
pub fn digest(path: &Path) -> Result<String, RecordError> {
    let bytes = bytes(path)?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(|error| malformed(path, error))?;
    let mut tensors = tensors.tensors();
    tensors.sort_by(|(a, _), (b, _)| a.cmp(b));
    let mut hasher = blake3::Hasher::new();
    for (name, view) in tensors {
        hasher.update(format!("{name} {:?} {:?} ", view.dtype(), view.shape()).as_bytes());
        hasher.update(view.data());
    }
    Ok(hasher.finalize().to_hex().to_string())
}

fn bytes(path: &Path) -> Result<Vec<u8>, RecordError> {
    read_bounded(path, LIMIT)?.ok_or_else(|| malformed(path, PolicyError::Missing))
}

fn malformed(path: &Path, error: impl Into<PolicyError>) -> RecordError {
    RecordError::Policy {
        path: path.to_owned(),
        source: error.into(),
    }
}

/// The normaliser's fields; it can be made from them by its serialised form alone.
#[derive(Serialize, Deserialize)]
struct NormalizerParts {
    count: f64,
    mean: Vec<f64>,
    deviations: Vec<f64>,
    clip: f64,
}

/// Little-endian numbers on their way to a file.
struct Tensor {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

fn encode(agent: &Agent, stamp: &Stamp) -> Result<Vec<u8>, PolicyError> {
    let mut tensors = Vec::new();
    push_network(&mut tensors, "policy.mean", agent.policy.mean());
    push_f32(
        &mut tensors,
        "policy.log_std",
        vec![agent.policy.log_std().len()],
        agent.policy.log_std().to_vec(),
    );
    push_network(&mut tensors, "value", &agent.value);
    let parts: NormalizerParts = serde_json::to_value(&agent.normalizer)
        .and_then(serde_json::from_value)
        .map_err(PolicyError::NormalizerParts)?;
    push_f64(&mut tensors, "normalizer.mean", &parts.mean);
    push_f64(&mut tensors, "normalizer.std", &agent.normalizer.std());
    push_f64(&mut tensors, "normalizer.deviations", &parts.deviations);
    push_f64(&mut tensors, "normalizer.count", &[parts.count]);
    push_f64(&mut tensors, "normalizer.clip", &[parts.clip]);
    let stamp = serde_json::to_string(&stamp.without_origin()).map_err(PolicyError::Stamp)?;
    let metadata = HashMap::from([(Stamp::KEY.to_owned(), stamp)]);
    let views: Result<Vec<_>, SafeTensorError> = tensors
        .iter()
        .map(|(name, tensor)| {
            Ok((
                name,
                TensorView::new(tensor.dtype, tensor.shape.clone(), &tensor.bytes)?,
            ))
        })
        .collect();
    Ok(safetensors::serialize(views?, Some(metadata))?)
}

fn push_network(tensors: &mut Vec<(String, Tensor)>, name: &str, network: &Mlp) {
    for (index, (weights, biases)) in network.layers().enumerate() {
        let (outputs, inputs) = weights.shape();
        let by_rows = (0..outputs)
            .flat_map(|row| (0..inputs).map(move |column| weights[(row, column)]))
            .collect();
        push_f32(
            tensors,
            &format!("{name}.{index}.weight"),
            vec![outputs, inputs],
            by_rows,
        );
        push_f32(
            tensors,
            &format!("{name}.{index}.bias"),
            vec![outputs],
            biases.to_vec(),
        );
    }
}

fn push_f32(tensors: &mut Vec<(String, Tensor)>, name: &str, shape: Vec<usize>, numbers: Vec<f32>) {
    let bytes = numbers.into_iter().flat_map(f32::to_le_bytes).collect();
    let dtype = Dtype::F32;
    tensors.push((
        name.to_owned(),
        Tensor {
            dtype,
            shape,
            bytes,
        },
    ));
}

fn push_f64(tensors: &mut Vec<(String, Tensor)>, name: &str, numbers: &[f64]) {
    let bytes = numbers.iter().copied().flat_map(f64::to_le_bytes).collect();
    let (dtype, shape) = (Dtype::F64, vec![numbers.len()]);
    tensors.push((
        name.to_owned(),
        Tensor {
            dtype,
            shape,
            bytes,
        },
    ));
}

fn decode(bytes: &[u8]) -> Result<(Agent, Stamp), PolicyError> {
    let (_, header) = SafeTensors::read_metadata(bytes)?;
    let stamp = header
        .metadata()
        .as_ref()
        .and_then(|metadata| metadata.get(Stamp::KEY));
    let stamp = stamp.ok_or(PolicyError::NoStamp)?;
    let stamp = serde_json::from_str(stamp).map_err(PolicyError::Stamp)?;
    let tensors = SafeTensors::deserialize(bytes)?;

    let normalizer = read_normalizer(&tensors)?;
    let mean = read_network(&tensors, "policy.mean")?;
    let value = read_network(&tensors, "value")?;
    let log_std = read_vector(
        &tensors,
        "policy.log_std",
        f32::from_le_bytes,
        f32::is_finite,
    )?;
    let fits = [
        ("policy.log_std", log_std.len(), mean.outputs),
        ("value", value.outputs, 1),
        ("the value network's input", value.inputs, mean.inputs),
        ("normalizer.mean", normalizer.mean().len(), mean.inputs),
    ];
    for (quantity, found, needed) in fits {
        if found != needed {
            return Err(PolicyError::Length {
                quantity: quantity.to_owned(),
                found,
                needed,
                other: "the policy's network",
            });
        }
    }
    // The initial weights are overwritten: networks have no constructor from weights.
    let mut unused = Seed(0).stream(Stream::Network, 0);
    let (inputs, outputs) = (mean.inputs, mean.outputs);
    let mut policy = GaussianPolicy::new(inputs, &mean.hidden, outputs, 1.0, &mut unused);
    policy.set_parameters(&[mean.parameters, log_std].concat());
    let widths = [&[value.inputs], value.hidden.as_slice(), &[value.outputs]].concat();
    let mut value_network = Mlp::new(&widths, 1.0, &mut unused);
    value_network
        .parameters_mut()
        .copy_from_slice(&value.parameters);
    Ok((
        Agent {
            policy,
            value: value_network,
            normalizer,
        },
        stamp,
    ))
}

fn read_normalizer(tensors: &SafeTensors<'_>) -> Result<Normalizer, PolicyError> {
    let vector = |name: &str| read_vector(tensors, name, f64::from_le_bytes, f64::is_finite);
    let scalar = |name: &str| match vector(name)?[..] {
        [number] => Ok(number),
        ref numbers => Err(PolicyError::Shape {
            tensor: name.to_owned(),
            found: vec![numbers.len()],
            needed: "[1]",
        }),
    };
    let (mean, deviations) = (vector("normalizer.mean")?, vector("normalizer.deviations")?);
    let (count, clip) = (scalar("normalizer.count")?, scalar("normalizer.clip")?);
    if mean.len() != deviations.len()
        || count < 0.0
        || clip <= 0.0
        || deviations.iter().any(|&sum| sum < 0.0)
    {
        return Err(PolicyError::Normalizer);
    }
    serde_json::to_value(NormalizerParts {
        count,
        mean,
        deviations,
        clip,
    })
    .and_then(serde_json::from_value)
    .map_err(PolicyError::NormalizerParts)
}

/// A network as a file holds it.
struct Network {
    inputs: usize,
    /// The widths of the hidden layers.
    hidden: Vec<usize>,
    outputs: usize,
    /// As [`Mlp::parameters`] lays them out.
    parameters: Vec<f32>,
}

fn read_network(tensors: &SafeTensors<'_>, name: &str) -> Result<Network, PolicyError> {
    let (mut widths, mut parameters) = (Vec::new(), Vec::new());
    for index in 0.. {
        let weight = format!("{name}.{index}.weight");
        let Ok(view) = tensors.tensor(&weight) else {
            break;
        };
        let &[outputs, inputs] = view.shape() else {
            return Err(PolicyError::Shape {
                tensor: weight,
                found: view.shape().to_vec(),
                needed: "[out, in]",
            });
        };
        if outputs == 0 || inputs == 0 || widths.last().is_some_and(|&before| before != inputs) {
            return Err(PolicyError::Layer {
                tensor: weight,
                found: [outputs, inputs],
                before: widths,
            });
        }
        let by_rows = numbers(&view, &weight, f32::from_le_bytes, f32::is_finite)?;
        let bias = format!("{name}.{index}.bias");
        let biases = read_vector(tensors, &bias, f32::from_le_bytes, f32::is_finite)?;
        if biases.len() != outputs {
            return Err(PolicyError::Length {
                quantity: bias,
                found: biases.len(),
                needed: outputs,
                other: "its weight",
            });
        }
        if widths.is_empty() {
            widths.push(inputs);
        }
        widths.push(outputs);
        // Files hold weights row by row, networks column by column.
        parameters
            .extend((0..inputs).flat_map(|column| by_rows.iter().skip(column).step_by(inputs)));
        parameters.extend(biases);
    }
    let [inputs, ref hidden @ .., outputs] = widths[..] else {
        return Err(PolicyError::NoTensor(format!("{name}.0.weight")));
    };
    Ok(Network {
        inputs,
        hidden: hidden.to_vec(),
        outputs,
        parameters,
    })
}

fn read_vector<T: Copy, const N: usize>(
    tensors: &SafeTensors<'_>,
    name: &str,
    decode: fn([u8; N]) -> T,
    is_finite: fn(T) -> bool,
) -> Result<Vec<T>, PolicyError> {
    let view = tensors
        .tensor(name)
        .map_err(|_| PolicyError::NoTensor(name.to_owned()))?;
    if view.shape().len() != 1 {
        return Err(PolicyError::Shape {
            tensor: name.to_owned(),
            found: view.shape().to_vec(),
            needed: "one dimension",
        });
    }
    numbers(&view, name, decode, is_finite)
}

fn numbers<T: Copy, const N: usize>(
    view: &TensorView<'_>,
    name: &str,
    decode: fn([u8; N]) -> T,
    is_finite: fn(T) -> bool,
) -> Result<Vec<T>, PolicyError> {
    let needed = if N == 4 { Dtype::F32 } else { Dtype::F64 };
    if view.dtype() != needed {
        return Err(PolicyError::WrongType {
            tensor: name.to_owned(),
            found: view.dtype(),
            needed,
        });
    }
    let (chunks, _) = view.data().as_chunks::<N>();
    let numbers: Vec<T> = chunks.iter().map(|&bytes| decode(bytes)).collect();
    match numbers.iter().position(|&number| !is_finite(number)) {
        Some(place) => Err(PolicyError::NotFinite {
            tensor: name.to_owned(),
            place,
        }),
        None => Ok(numbers),
    }
}

#[cfg(test)]
mod tests;
