//! A run as a TensorBoard event file.
//!
//! Owns the bytes: records with masked CRC-32C around `Event` messages of protocol buffers, of
//! which it writes the few fields that it needs (tensorflow/core/util/event.proto,
//! tensorboard/plugins/hparams/plugin_data.proto). Start at [`events`].

use std::collections::BTreeMap;

use serde_json::Value;

use crate::{
    measured::{Column, Iteration, Measure, Role, progress},
    plan,
    report::{
        over_seeds::values_of,
        recorded::{Recording, Run},
    },
};

/// The keys of a specification that are not settings.
const NAMES: [&str; 6] = [
    "experiment",
    "id",
    "axes",
    "columns",
    "demonstration",
    "checkpoint",
];

/// The events of `run`: its hyperparameters, every column of its iterations, and its evaluations'
/// means. Wall time is the time that training had taken, from 0.
pub fn events(run: &Run) -> Vec<u8> {
    // An event file begins with the version of its format.
    let mut bytes = record(
        &Message::default()
            .double(1, 0.0)
            .bytes(3, b"brain.Event:2")
            .0,
    );
    let Some(recording) = run.recording() else {
        return bytes;
    };
    bytes.extend(record(&event(0.0, 0, &start(run))));
    let clock = clock(recording);
    let mut scalar = |tag: &str, points: Vec<(u64, f64)>| {
        for (step, value) in points {
            // Evaluations have no clock of their own, and take the time of the last iteration
            // before them.
            let seconds = clock
                .range(..=step)
                .next_back()
                .map_or(0.0, |(_, seconds)| *seconds);
            let value = Message::default()
                .bytes(1, tag.as_bytes())
                .float(2, value as f32);
            bytes.extend(record(&event(seconds, step, &value)));
        }
    };
    scalar("evaluation/return", values_of(recording, Measure::Return));
    let mut columns: Vec<_> = progress::COLUMNS
        .iter()
        .filter(|column| column.role != Role::Position)
        .collect();
    columns.sort_by_key(|column| column.name);
    for column in columns
        .into_iter()
        .filter(|column| recording.progress.get(column).is_some())
    {
        scalar(
            &format!("progress/{}", column.called()),
            values_of(recording, Measure::Column(column)),
        );
    }
    let end = Message::default().varint(1, 1); // STATUS_SUCCESS
    bytes.extend(record(&event(
        clock.values().last().copied().unwrap_or(0.0),
        0,
        &hparams("session_end_info", 4, &end),
    )));
    bytes
}

/// The seconds that training had taken, by environment steps.
fn clock(recording: &Recording) -> BTreeMap<u64, f64> {
    let column = |column: &Column<Iteration>| recording.progress.get(column).unwrap_or_default();
    let (rollout, update) = (
        column(&progress::ROLLOUT_SECONDS),
        column(&progress::UPDATE_SECONDS),
    );
    let mut seconds = 0.0;
    let of_row = |(row, steps): (usize, &Option<f64>)| {
        let cell = |cells: &[Option<f64>]| cells.get(row).copied().flatten().unwrap_or(0.0);
        seconds += cell(rollout) + cell(update);
        Some(((*steps)? as u64, seconds))
    };
    column(&progress::ENV_STEPS)
        .iter()
        .enumerate()
        .filter_map(of_row)
        .collect()
}

fn event(seconds: f64, step: u64, value: &Message) -> Vec<u8> {
    Message::default()
        .double(1, seconds)
        .varint(2, step)
        .message(5, &Message::default().message(1, value))
        .0
}

/// The hyperparameters of the run; the seeds of one method form one group.
fn start(run: &Run) -> Message {
    let mut settings = BTreeMap::new();
    if let Ok(Value::Object(fields)) = serde_json::to_value(&run.spec) {
        for (name, value) in fields
            .into_iter()
            .filter(|(name, _)| !NAMES.contains(&name.as_str()))
        {
            // Hyperparameters are called `mcpo.d`, without `algorithm` before it.
            let key = if name == "algorithm" {
                String::new()
            } else {
                name
            };
            settings.extend(plan::leaves(key, &value).map(|(key, leaf)| (key, leaf.clone())));
        }
    }
    settings.insert(
        "algorithm".to_owned(),
        Value::from(run.spec.algorithm_name()),
    );
    let entry = |message: Message, (key, value): (&String, &Value)| {
        // The fields of google.protobuf.Value: 2 is a number, 3 a text, 4 a truth value.
        let value = match value {
            Value::Number(number) => {
                Message::default().double(2, number.as_f64().unwrap_or(f64::NAN))
            }
            Value::Bool(truth) => Message::default().varint(4, u64::from(*truth)),
            Value::String(text) => Message::default().bytes(3, text.as_bytes()),
            other => Message::default().bytes(3, other.to_string().as_bytes()),
        };
        // A map is a list of messages, each with a key (1) and a value (2).
        message.message(
            1,
            &Message::default()
                .bytes(1, key.as_bytes())
                .message(2, &value),
        )
    };
    let group = run
        .spec
        .id
        .rsplit_once('/')
        .map_or(run.spec.id.as_str(), |(group, _)| group);
    let info = settings
        .iter()
        .fold(Message::default(), entry)
        .bytes(4, group.as_bytes());
    hparams("session_start_info", 3, &info)
}

/// A summary value of the plugin for hyperparameters: its data are in the metadata, beside an empty
/// tensor.
fn hparams(name: &str, field: u32, data: &Message) -> Message {
    let plugin = Message::default()
        .bytes(1, b"hparams")
        .message(2, &Message::default().message(field, data));
    let no_elements = Message::default().message(2, &Message::default().varint(1, 0));
    let no_floats = Message::default().varint(1, 1).message(2, &no_elements); // DT_FLOAT
    Message::default()
        .bytes(1, format!("_hparams_/{name}").as_bytes())
        .message(8, &no_floats)
        .message(9, &Message::default().message(1, &plugin))
}

/// A message of protocol buffers, field by field.
#[derive(Debug, Clone, Default)]
struct Message(Vec<u8>);

impl Message {
    fn key(&mut self, field: u32, kind: u8) {
        self.number(u64::from(field) << 3 | u64::from(kind));
    }

    fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.0.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.0.push(number as u8);
    }

    fn varint(mut self, field: u32, number: u64) -> Self {
        self.key(field, 0);
        self.number(number);
        self
    }

    fn double(mut self, field: u32, number: f64) -> Self {
        self.key(field, 1);
        self.0.extend(number.to_le_bytes());
        self
    }

    fn float(mut self, field: u32, number: f32) -> Self {
        self.key(field, 5);
        self.0.extend(number.to_le_bytes());
        self
    }

    fn bytes(mut self, field: u32, bytes: &[u8]) -> Self {
        self.key(field, 2);
        self.number(bytes.len() as u64);
        self.0.extend(bytes);
        self
    }

    fn message(self, field: u32, message: &Self) -> Self {
        self.bytes(field, &message.0)
    }
}

/// A record of TensorFlow's: its length and its data, each with a checksum behind it.
fn record(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    [
        &length[..],
        &masked(crc32c(&length)),
        data,
        &masked(crc32c(data)),
    ]
    .concat()
}

fn masked(checksum: u32) -> [u8; 4] {
    checksum
        .rotate_right(15)
        .wrapping_add(0xa282_ead8)
        .to_le_bytes()
}

/// CRC-32C (Castagnoli), bit by bit.
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    let shifted = |rest: u32, _| {
        if rest & 1 == 1 {
            rest >> 1 ^ 0x82f6_3b78
        } else {
            rest >> 1
        }
    };
    !bytes.iter().fold(u32::MAX, |rest, byte| {
        (0..8).fold(rest ^ u32::from(*byte), shifted)
    })
}
