//! The JSON Schema of a matrix file, for editors.

use serde_json::{Map, Value, json};

use super::{
    Algorithm, Drawing, Key, Parameter, Reference, Shown,
    catalog::{Catalog, Section},
    named::Named,
};
use crate::{env::EnvId, measured::Measure};

/// The names that an editor accepts for a user's robot: those without a Gym version at the end.
/// A name with one is more likely a mistyped environment that ships.
/// The parser, which knows the robots, is less strict.
const OWN: &str = "^(?!.*-v[0-9]+$)[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$";

/// The JSON Schema (draft 2020-12) of a matrix file: every key with its documentation.
pub fn schema() -> Value {
    let catalog = Catalog::get();
    let settings = properties(
        &catalog
            .settings
            .schema(&[])
            // A file may leave out any setting: it has a default, or another layer says it.
            .map(optional)
            .unwrap_or_default(),
    );
    let algorithms = object(
        "Hyperparameters, by the algorithm's name; the defaults are the paper's Tables 1 and 2",
        catalog
            .algorithms()
            .map(|(name, section)| {
                (
                    (*name).into(),
                    section.schema(&[]).map(optional).unwrap_or_default(),
                )
            })
            .collect(),
    );

    let environments = environments(&settings, &algorithms);
    let mut file = settings;
    let text = |description: &str| json!({ "type": "string", "description": description });
    file.insert(
        "name".into(),
        name("Name of the experiment, and of its folder under the results"),
    );
    file.insert("description".into(), text("A sentence for readers"));
    file.insert(
        "extends".into(),
        text("A weaker file, relative to this one, whose keys apply where this one is silent"),
    );
    let mut matrix = list(
        "Blocks; every combination of a block's lists is one run",
        block(),
    );
    matrix["minItems"] = json!(1);
    file.insert("matrix".into(), matrix);
    file.insert("algorithms".into(), algorithms);
    file.insert("environments".into(), environments);
    for (key, what, section) in [
        ("figures", "Learning curves", &catalog.figure),
        ("tables", "Tables of returns", &catalog.table),
        (
            "settings",
            "Tables of what was set",
            &catalog.settings_table,
        ),
    ] {
        file.insert(key.into(), list(what, shown(section)));
    }
    file.insert(
        "claims".into(),
        list(
            "What the paper says, judged by what is recorded",
            claim(&catalog.claim),
        ),
    );
    file.extend(properties(
        &catalog.slurm.schema(&[]).map(optional).unwrap_or_default(),
    ));
    let mut schema = object("An experiment of mcpo-run", file);
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!("mcpo-run experiment");
    // A file that extends another may leave its name and matrix to that.
    schema["anyOf"] = json!([{ "required": ["extends"] }, { "required": ["name", "matrix"] }]);
    schema
}

/// The tables of environments, those that ship and one's own: `settings`, and `algorithms` in each.
fn environments(settings: &Map<String, Value>, algorithms: &Value) -> Value {
    let catalog = Catalog::get();
    let mut environment = settings.clone();
    environment.insert("algorithms".into(), algorithms.clone());
    let mut robot = environment.clone();
    robot.extend(properties(
        catalog.robot.schema(&[]).unwrap_or(&Value::Null),
    ));
    let robot = object(
        "A robot of one's own, with settings and hyperparameters for it alone",
        robot,
    );
    let environment = object(
        "Settings and hyperparameters for one environment alone",
        environment,
    );
    let environments = EnvId::known()
        .map(|(name, _)| (name.to_owned(), environment.clone()))
        .collect();
    let mut environments = object(
        "Settings by the environment's name, Gym's or the paper's, or one's own",
        environments,
    );
    environments["patternProperties"] = json!({ (OWN): robot });
    environments
}

/// A figure, a table of returns or one of settings, with the names that it can show.
fn shown(section: &Section) -> Value {
    let mut element = section.schema(&[]).cloned().unwrap_or_default();
    let fields = &mut element["properties"];
    fields["name"] = name("File name without extension");
    // The types' own schemas allow any text; editors should offer the known names.
    for (field, names) in [
        ("y", Drawing::names().map(str::to_owned).collect()),
        ("reference", Reference::known()),
        ("columns", Key::known()),
    ] {
        fields
            .get_mut(field)
            .into_iter()
            .for_each(|schema| one_of(schema, &names));
    }
    if let Some(axis) = fields
        .get_mut("panels")
        .and_then(|panels| panels["anyOf"].get_mut(0))
    {
        one_of(axis, &Key::known());
    }
    // Each kind of table has some of these fields.
    for (field, names) in [
        ("series", Key::known()),
        ("rows", Key::known()),
        ("show", Shown::known()),
    ] {
        let items = fields.get_mut(field).and_then(|list| list.get_mut("items"));
        items.into_iter().for_each(|schema| one_of(schema, &names));
    }
    element
}

/// A block of the matrix: a list for every parameter.
fn block() -> Value {
    let values = |description: &str, items: Value| {
        json!({
            "type": "array",
            "minItems": 1,
            "uniqueItems": true,
            "description": description,
            "items": items,
        })
    };
    let environments: Vec<&str> = EnvId::known().map(|(name, _)| name).collect();
    let mut keys = Map::new();
    keys.insert(
        "seed".into(),
        values(
            "Seeds",
            // TOML's whole numbers end there, though a seed has 64 bits.
            json!({ "type": "integer", "minimum": 0, "maximum": i64::MAX }),
        ),
    );
    keys.insert(
        "env".into(),
        values(
            "Environments",
            json!({ "anyOf": [{ "enum": environments }, { "type": "string", "pattern": OWN }] }),
        ),
    );
    let algorithms: Vec<&str> = Algorithm::names().collect();
    keys.insert(
        "algorithm".into(),
        values("Algorithms", json!({ "enum": algorithms })),
    );
    for name in Parameter::names() {
        if let Some(schema) = value(&name) {
            let description = schema["description"]
                .as_str()
                .unwrap_or_default()
                .to_owned();
            keys.insert(name, values(&description, schema));
        }
    }
    let mut block = object("One block of the matrix", keys);
    block["required"] = json!(["seed", "env", "algorithm"]);
    block
}

/// A claim: a constraint that is kept has no comparison, any other claim has one.
fn claim(section: &Section) -> Value {
    let mut claim = section.schema(&[]).cloned().unwrap_or_default();
    one_of(
        &mut claim["properties"]["on"],
        &Measure::names().map(str::to_owned).collect::<Vec<_>>(),
    );
    let relation = |names: &[&str]| json!({ "is": { "enum": names } });
    let mut compared = relation(&["above", "below"]);
    compared["share"] = json!(false);
    let mut like = relation(&["like"]);
    like["share"] = json!(false);
    like["margin"] = json!({ "exclusiveMinimum": 0 });
    let mut kept = relation(&["kept"]);
    for key in ["than", "on", "at", "margin"] {
        kept[key] = json!(false);
    }
    claim["oneOf"] = json!([
        { "properties": compared, "required": ["than"] },
        { "properties": like, "required": ["than", "margin"] },
        { "properties": kept },
    ]);
    claim
}

/// The schema of one value of the parameter called `name`.
fn value(name: &str) -> Option<Value> {
    let catalog = Catalog::get();
    let parameter = Parameter::find(name)?;
    let of =
        |section: &Section, key: &str| section.schema(&key.split('.').collect::<Vec<_>>()).cloned();
    match &parameter {
        Parameter::Setting(key) => of(&catalog.settings, key),
        _ => catalog
            .algorithms()
            .find_map(|(algorithm, section)| of(section, parameter.hyperparameter_of(algorithm)?)),
    }
}

/// Restricts `schema`, of a text, to the values `names`.
fn one_of(schema: &mut Value, names: &[String]) {
    if let Some(fields) = schema.as_object_mut() {
        let may_be_absent = fields["type"].is_array();
        let names = names
            .iter()
            .map(|name| json!(name))
            .chain(may_be_absent.then_some(Value::Null));
        fields.insert("enum".into(), names.collect());
        fields.remove("type");
    }
}

fn object(description: &str, properties: Map<String, Value>) -> Value {
    json!({
        "type": "object",
        "description": description,
        "properties": properties,
        "additionalProperties": false,
    })
}

fn list(description: &str, items: Value) -> Value {
    json!({ "type": "array", "description": description, "items": items })
}

fn name(description: &str) -> Value {
    json!({
        "type": "string",
        "description": description,
        "pattern": "^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$",
    })
}

fn properties(schema: &Value) -> Map<String, Value> {
    schema["properties"]
        .as_object()
        .cloned()
        .unwrap_or_default()
}

/// `schema` with no key required, since every one has a default; the fields of choices, such as a
/// reward's, stay required.
fn optional(schema: &Value) -> Value {
    let mut schema = schema.clone();
    if let Some(fields) = schema
        .as_object_mut()
        .filter(|fields| fields.contains_key("properties"))
    {
        fields.remove("required");
        if let Some(Value::Object(properties)) = fields.get_mut("properties") {
            properties
                .values_mut()
                .for_each(|inner| *inner = optional(inner));
        }
    }
    schema
}
