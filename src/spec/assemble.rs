//! From layers to one specification: parse, check each alone, merge, check together.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::{
    Axis, Block, ExperimentSpec, Overrides, Parameter, Settings, SpecErrors,
    arguments::{self, AxisList},
    catalog::Catalog,
    check::{BLOCK_KEYS, check},
    combinations::Draft,
    error::SpecError,
    layer::{self, Layer},
    layers,
    names::nearest_label,
    robots::{Robots, is_robots_alone},
    source::Source,
};
use crate::fit::{self, Step};

/// Reads, merges and checks all layers. A given `text` stands in for the file's content;
/// environment variables are then ignored.
pub(super) fn assemble(
    path: &Path,
    text: Option<&str>,
    overrides: &Overrides,
) -> Result<ExperimentSpec, SpecErrors> {
    let (mut layers, mut errors) = layer::files(path, text);
    if layers.is_empty() {
        return Err(
            SpecErrors::none_or(errors).expect_err("a file that was not read has its error")
        );
    }
    let (stronger, wrong) = arguments::overriding(overrides, text.is_none());
    layers.extend(stronger);
    errors.extend(wrong);
    let (mut axes, wrong) = arguments::axis_lists(overrides);
    errors.extend(wrong);

    let (parsed, slips): (Vec<_>, Vec<_>) = layers.iter().map(Layer::parse).unzip();
    // A text that is not TOML gets its syntax errors alone: any other message about it would
    // mislead.
    SpecErrors::none_or(slips.concat())?;
    let sources: Vec<Source<'_>> = parsed;
    let (robots, wrong) = Robots::read(&sources);
    errors.extend(wrong);
    let mut tables = Vec::new();
    for (layer, source) in layers.iter().zip(&sources) {
        let mut checked = check(source, &axes, &robots);
        errors.extend(checked.errors);
        anchor(&mut checked.table, layer);
        tables.push(checked.table);
    }
    // Where a single value is wrong, its own message says so, and better.
    if errors.is_empty() {
        errors.extend(robots.unread.iter().cloned());
    }
    // A list with a mistake of its own replaces nothing.
    axes.retain(|axis| {
        !errors
            .iter()
            .any(|error| error.place == axis.layer.place(0..0))
    });

    let merged = layers::merge(tables);
    let (mut spec, indices) = build(
        merged,
        path,
        &Written {
            sources: &sources,
            axes: &axes,
            robots: &robots,
        },
        &mut errors,
    );
    let draft = Draft {
        spec: &spec,
        indices: &indices,
        sources: &sources,
        axes: &axes,
        known: &errors,
    };
    let findings = draft.check();
    errors.extend(findings.errors);
    spec.missing = findings.missing;
    SpecErrors::none_or(errors)?;
    Ok(spec)
}

/// Lets relative paths in `table` start at the folder of their file.
fn anchor(table: &mut toml::Table, layer: &Layer) {
    fn join(value: &mut toml::Value, folder: &Path) {
        match value {
            toml::Value::String(path) => *path = folder.join(&*path).to_string_lossy().into_owned(),
            toml::Value::Array(paths) => paths.iter_mut().for_each(|path| join(path, folder)),
            _ => {}
        }
    }
    const KEY: &str = "demonstrations";
    if let Some(path) = table.get_mut(KEY) {
        join(path, layer.folder());
    }
    if let Some(toml::Value::Table(environments)) = table.get_mut("environments") {
        environments
            .iter_mut()
            .filter_map(|(_, own)| own.get_mut(KEY))
            .for_each(|path| join(path, layer.folder()));
    }
    if let Some(toml::Value::Array(blocks)) = table.get_mut("matrix") {
        blocks
            .iter_mut()
            .filter_map(|block| block.get_mut(KEY))
            .for_each(|path| join(path, layer.folder()));
    }
}

/// The specification in `merged`, and the place of each of its blocks in the file's list.
fn build(
    mut merged: toml::Table,
    path: &Path,
    written: &Written<'_>,
    errors: &mut Vec<SpecError>,
) -> (ExperimentSpec, Vec<usize>) {
    // What has another type is reported already, and counts as absent here.
    let text = |value: Option<toml::Value>| {
        value
            .and_then(|value| value.as_str().map(str::to_owned))
            .unwrap_or_default()
    };
    let table = |value: Option<toml::Value>| match value {
        Some(toml::Value::Table(table)) => table,
        _ => toml::Table::new(),
    };
    let name = text(merged.remove("name"));
    let description = text(merged.remove("description"));
    let (indices, matrix) = blocks(merged.remove("matrix"), written, errors)
        .into_iter()
        .unzip();
    let algorithms = table(merged.remove("algorithms"));
    let environments = table(merged.remove("environments"))
        .into_iter()
        .filter_map(|(name, own)| {
            Some((
                written.robots.find(&name).ok()?,
                settings_of(own.as_table()?),
            ))
        })
        .collect();
    let figures = list(merged.remove("figures"));
    let tables = list(merged.remove("tables"));
    let claims = list(merged.remove("claims"));
    let settings_tables = list(merged.remove("settings"));
    let slurm = table(merged.remove("slurm"));
    let slurm = fit::read(slurm.into()).unwrap_or_default(); // what was wrong in it is told
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    // Where nothing else is said, demonstrations lie beside the file that the others extend.
    let mut settings = toml::Table::new();
    let first = written
        .sources
        .first()
        .map_or(folder.as_path(), |source| source.layer.folder());
    let beside = first
        .join(Settings::DEMONSTRATIONS)
        .to_string_lossy()
        .into_owned();
    settings.insert("demonstrations".into(), toml::Value::String(beside));
    settings.extend(
        merged
            .into_iter()
            .filter(|(key, _)| Catalog::get().settings.schema(&[key.as_str()]).is_some()),
    );
    let spec = ExperimentSpec {
        name,
        description,
        settings,
        algorithms,
        environments,
        matrix,
        figures,
        tables,
        claims,
        settings_tables,
        file: path.to_owned(),
        slurm,
        folder,
        missing: Vec::new(),
    };
    (spec, indices)
}

/// The sources of a specification, beside its merged table.
struct Written<'a> {
    /// The layers, weakest first.
    sources: &'a [Source<'a>],
    /// The lists that replace axes.
    axes: &'a [AxisList],
    robots: &'a Robots,
}

/// The settings in an environment's table, without the keys that describe a robot.
fn settings_of(table: &toml::Table) -> toml::Table {
    let settings = table.iter().filter(|(key, _)| !is_robots_alone(key));
    settings
        .map(|(key, value)| (key.clone(), value.clone()))
        .collect()
}

/// Replaces each -0.0 by the 0.0 that it means: no parameter tells the two apart.
fn without_negative_zero(value: &mut toml::Value) {
    match value {
        toml::Value::Float(number) => *number += 0.0,
        toml::Value::Array(values) => values.iter_mut().for_each(without_negative_zero),
        toml::Value::Table(table) => table
            .iter_mut()
            .for_each(|(_, value)| without_negative_zero(value)),
        _ => {}
    }
}

/// The elements that parse as `T`; the others are already reported.
fn list<T: DeserializeOwned>(value: Option<toml::Value>) -> Vec<T> {
    let elements = value
        .and_then(|value| value.as_array().cloned())
        .unwrap_or_default();
    elements
        .into_iter()
        .filter_map(|element| fit::read(element).ok())
        .collect()
}

/// The blocks with their indices, their axes in the order of the file.
fn blocks(
    value: Option<toml::Value>,
    &Written {
        sources,
        axes,
        robots,
    }: &Written<'_>,
    errors: &mut Vec<SpecError>,
) -> Vec<(usize, Block)> {
    let tables = value
        .and_then(|value| value.as_array().cloned())
        .unwrap_or_default();
    let mut had: Vec<String> = Vec::new();
    let mut blocks = Vec::new();
    for (index, table) in tables.into_iter().enumerate() {
        // The check has reported it; the other blocks keep their places in the file's list.
        let toml::Value::Table(table) = table else {
            continue;
        };
        let start = |key: &str| {
            let way = [
                Step::Key("matrix".into()),
                Step::Index(index),
                Step::Key(key.into()),
            ];
            sources
                .iter()
                // The strongest layer that has the list wrote it.
                .rev()
                .find_map(|source| source.span(&way))
                .map_or(0, |span| span.start)
        };
        let mut lists: Vec<_> = table
            .into_iter()
            .filter_map(|(key, values)| Some((start(&key), key, values.as_array()?.clone())))
            .collect();
        // Axes count in the file's order, which a merged table need not keep.
        lists.sort_by_key(|(start, ..)| *start);
        let mut block = Block::default();
        for (_, key, mut values) in lists {
            if let Some(axis) = axes.iter().find(|axis| axis.key == key) {
                values = axis.values();
            }
            // -0.0 and 0.0 would be two runs with one meaning.
            values.iter_mut().for_each(without_negative_zero);
            match key.as_str() {
                "seed" => {
                    block.seed = values
                        .iter()
                        .filter_map(|seed| u64::try_from(seed.as_integer()?).ok())
                        .collect()
                }
                "env" => {
                    block.env = values
                        .iter()
                        .filter_map(|name| robots.find(name.as_str()?).ok())
                        .collect()
                }
                "algorithm" => {
                    block.algorithm = values
                        .iter()
                        .filter_map(|name| name.as_str().map(str::to_owned))
                        .collect();
                }
                _ => block
                    .axes
                    .extend(Parameter::find(&key).map(|parameter| Axis { parameter, values })),
            }
            had.push(key);
        }
        blocks.push((index, block));
    }
    // An argument that no block has would do nothing, and say nothing.
    for axis in axes.iter().filter(|axis| !had.contains(&axis.key)) {
        errors.push(SpecError::new(
            format!("no block of the matrix has the axis `{}`", axis.key),
            axis.layer.place(0..0),
            nearest_label(
                "axis",
                &axis.key,
                BLOCK_KEYS.into_iter().chain(had.iter().map(String::as_str)),
            ),
        ));
    }
    blocks
}
