//! The identity of an environment: its name, or the whole table of a user's robot.

use std::{cmp::Ordering, fmt, path::PathBuf, str::FromStr};

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{self, MapAccess, Visitor, value::MapAccessDeserializer},
};

use super::{
    EnvError, Environment, Reward, Spaces,
    catalog::{self, Descriptor, SHIPPED, Version, descriptor},
    mujoco::Model,
    robot::Robot,
};

/// An environment: one that ships, or a user's robot.
/// It is serialised as its name; a user's robot with its table and its model, so that whatever
/// holds it can be read elsewhere.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct EnvId(usize);

#[expect(
    non_upper_case_globals,
    reason = "they stand where the variants of an enumeration would, and there are more"
)]
impl EnvId {
    /// `MountainCarContinuous-v0`; the paper says MountainCar-v0.
    pub const MountainCar: Self = Self(0);
    /// `InvertedPendulum-v2`; the paper says Pendulum-v2.
    pub const InvertedPendulum: Self = Self(1);
    /// `InvertedDoublePendulum-v2`; the paper says DoublePendulum-v2.
    pub const InvertedDoublePendulum: Self = Self(2);
    /// `HalfCheetah-v2`.
    pub const HalfCheetah: Self = Self(3);
    /// `Hopper-v2`.
    pub const Hopper: Self = Self(4);
    /// `Walker2d-v2`.
    pub const Walker2d: Self = Self(5);
    /// `Ant-v2`, with contact forces: 111 observations.
    pub const Ant: Self = Self(6);

    /// All environments of the paper, in its order; [`shipped`](Self::shipped) gives the others
    /// too.
    pub const ALL: [Self; 7] = [
        Self::MountainCar,
        Self::InvertedPendulum,
        Self::InvertedDoublePendulum,
        Self::HalfCheetah,
        Self::Hopper,
        Self::Walker2d,
        Self::Ant,
    ];
}

impl EnvId {
    /// All environments that ship: the paper's first, in its order.
    pub fn shipped() -> impl Iterator<Item = Self> {
        (0..SHIPPED.len()).map(Self)
    }

    /// The user's `robot`, called `name`, whose model stands at [`Robot::model`].
    /// The model and the files that it needs are read now; later changes of the model's file have
    /// no effect.
    ///
    /// # Errors
    ///
    /// The name is taken or cannot name a folder; the model cannot be read, or MuJoCo refuses it;
    /// the model lacks something that the table names.
    pub fn of_robot(name: &str, robot: Robot) -> Result<Self, EnvError> {
        if let Some((_, shipped)) =
            Self::known().find(|(known, _)| known.eq_ignore_ascii_case(name))
        {
            return Err(EnvError::NameTaken {
                name: name.to_owned(),
                by: shipped,
            });
        }
        let wrong = |key| {
            move |flaw| EnvError::Robot {
                env: name.to_owned(),
                key,
                index: None,
                flaw: Box::new(flaw),
            }
        };
        let model = Model::read(&robot.model).map_err(wrong("model"))?;
        // The same model makes the same robot, wherever its file stands.
        let file = robot
            .model
            .file_name()
            .map_or_else(PathBuf::new, PathBuf::from);
        let robot = Robot {
            model: file,
            ..robot
        };
        let id = Self::own(name, robot, model)?;
        id.build()?;
        Ok(id)
    }

    /// # Errors
    ///
    /// The name cannot name a folder.
    fn own(name: &str, robot: Robot, model: Model) -> Result<Self, EnvError> {
        if !is_file_name(name) {
            return Err(EnvError::BadName {
                name: name.to_owned(),
            });
        }
        Ok(Self(catalog::intern(name, robot, model)))
    }

    fn descriptor(self) -> &'static Descriptor {
        descriptor(self.0)
    }

    /// The Gym id, or the name that the user gave.
    pub fn name(self) -> &'static str {
        self.descriptor().name
    }

    /// The paper's name, which is Gym's but for three.
    pub fn paper_name(self) -> &'static str {
        self.descriptor().paper_name.unwrap_or(self.name())
    }

    /// Whether it is a user's robot.
    pub fn is_own(self) -> bool {
        self.descriptor().own().is_some()
    }

    /// The user's description of it; `None` if it ships.
    pub fn own_robot(self) -> Option<&'static Robot> {
        self.descriptor().own().map(|own| &own.robot)
    }

    /// The time limit, steps: Gym's, or the user's.
    pub fn max_steps(self) -> u64 {
        self.descriptor().max_steps
    }

    /// The reward that is trained on by default: the paper's sparse one, or the dense one of a
    /// user's robot.
    /// The paper prints no thresholds, so this project chose them.
    /// A metre, as in public environments around POfD; ten in HalfCheetah, which covers a metre by
    /// chance, and where methods then rank as in the paper.
    /// For poles, a height that the demonstration nearly always exceeds, and that a pole sinks
    /// below before its episode ends.
    pub fn default_reward(self) -> Reward {
        (self.descriptor().default_reward)()
    }

    /// The sparse reward of the environment, with some threshold; [`Reward::Dense`] if it has none.
    pub fn sparse_reward(self) -> Reward {
        self.descriptor().sparse_reward().unwrap_or(Reward::Dense)
    }

    /// The physics.
    ///
    /// # Errors
    ///
    /// The engine refuses the model.
    pub fn build(self) -> Result<Box<dyn Environment>, EnvError> {
        self.descriptor().build(self.tag())
    }

    /// The shapes and bounds; `None` if the engine refuses the model.
    pub fn spaces(self) -> Option<Spaces> {
        let spaces = || self.build().ok().map(|environment| environment.spaces());
        *self.descriptor().spaces.get_or_init(spaces)
    }

    /// The revision of its task: a new one gives other numbers.
    /// It does not cover the model; see [`model_digest`](Self::model_digest).
    pub fn revision(self) -> u32 {
        self.descriptor().revision
    }

    /// A digest of its model, hexadecimal; `None` for a task without one.
    pub fn model_digest(self) -> Option<String> {
        self.descriptor().robot().map(|(_, model)| model.digest())
    }

    /// Seconds of one step of physics on one core (frame skip included); a guess for a user's
    /// robot.
    pub fn physics_seconds(self) -> f64 {
        1e-6 * self.descriptor().microseconds
    }

    /// Whether Gymnasium keeps the state in f32, whose roundings add up over an episode.
    pub fn is_f32_in_gymnasium(self) -> bool {
        self.descriptor().is_f32_in_gymnasium
    }

    /// The other versions of it in Gym and Gymnasium.
    pub fn versions(self) -> &'static [Version] {
        self.descriptor().versions
    }

    /// Every name of the environments that ship, Gym's and the paper's.
    pub fn known() -> impl Iterator<Item = (&'static str, Self)> {
        Self::shipped().flat_map(|id| {
            std::iter::once(id.name())
                .chain(id.descriptor().paper_name)
                .map(move |name| (name, id))
        })
    }

    /// The message about an unknown `name`: the one that was probably meant, or all that are known,
    /// the user's `own` robots among them.
    pub fn known_instead(name: &str, own: &[&str]) -> String {
        if let Some((id, Some(number))) = Self::of_label(name)
            && name.eq_ignore_ascii_case(&format!("{}-v{number}", id.family()))
            && id.versions().iter().any(|version| version.number == number)
        {
            let difference = id.differs_in(number).map_or_else(
                || format!("v{number} takes the same steps except for the last bits"),
                |difference| format!("it is not the same: {difference}"),
            );
            return format!("the known one is `{id}`; {difference}");
        }
        let distance =
            |known: &str| strsim::damerau_levenshtein(&name.to_lowercase(), &known.to_lowercase());
        // The version is left out: all names share it, so it makes none alike.
        let letters = |name: &str| {
            name.split_once("-v")
                .map_or(name, |(family, _)| family)
                .len()
        };
        let distances = Self::known()
            .map(|(known, _)| known)
            .chain(own.iter().copied())
            .map(|known| (distance(known), known))
            .min();
        match distances
            .filter(|(distance, known)| 3 * distance <= letters(name).max(letters(known)))
        {
            Some((_, nearest)) => format!("the nearest known one is `{nearest}`"),
            None => {
                let mut names: Vec<&str> = Self::shipped().map(Self::name).collect();
                names.extend(own);
                let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
                format!("the known ones are {}", names.join(", "))
            }
        }
    }

    /// The number that marks a saved state as this environment's, the same in every process.
    fn tag(self) -> f64 {
        match self.descriptor().own() {
            None => self.0 as f64,
            // The numbers beyond those of what ships; f64 holds 53 bits.
            Some(own) => {
                (1_u64 << 48 | u64::from_str_radix(&own.digest[..12], 16).unwrap_or_default())
                    as f64
            }
        }
    }
}

/// Whether `name` can be the name of a file or folder anywhere.
fn is_file_name(name: &str) -> bool {
    let safe = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    (1..=100).contains(&name.len()) && !name.starts_with('.') && name.chars().all(safe)
}

impl Ord for EnvId {
    /// Orders what ships first, in its order; then the user's robots by name, whenever they were
    /// read.
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |id: Self| {
            let own = id.descriptor().own();
            (
                own.is_some(),
                if own.is_some() { 0 } else { id.0 },
                own.map(|own| (id.name(), own.digest.as_str())),
            )
        };
        key(*self).cmp(&key(*other))
    }
}

impl PartialOrd for EnvId {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for EnvId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Debug for EnvId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for EnvId {
    type Err = EnvError;

    /// An environment that ships, by Gym's or the paper's name; or the robot that was last read
    /// under this name.
    fn from_str(name: &str) -> Result<Self, EnvError> {
        let known = Self::known()
            .find(|(known, _)| *known == name)
            .map(|(_, id)| id);
        known
            .or_else(|| catalog::own_number(name).map(Self))
            .ok_or_else(|| EnvError::UnknownEnvironment {
                name: name.to_owned(),
                known: Self::known_instead(name, &catalog::own_names()),
            })
    }
}

/// The serialised form of a user's robot.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: String,
    robot: Robot,
    model: Model,
}

impl Serialize for EnvId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.descriptor().own() {
            None => serializer.serialize_str(self.name()),
            Some(own) => {
                let (robot, model) = (own.robot.clone(), own.model.clone());
                Written {
                    name: self.name().to_owned(),
                    robot,
                    model,
                }
                .serialize(serializer)
            }
        }
    }
}

impl<'de> Deserialize<'de> for EnvId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrTable;

        impl<'de> Visitor<'de> for NameOrTable {
            type Value = EnvId;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of an environment, or a robot with its table and its model")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<EnvId, E> {
                name.parse().map_err(E::custom)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<EnvId, A::Error> {
                let Written { name, robot, model } =
                    Written::deserialize(MapAccessDeserializer::new(map))?;
                EnvId::own(&name, robot, model).map_err(de::Error::custom)
            }
        }

        deserializer.deserialize_any(NameOrTable)
    }
}

#[cfg(test)]
mod tests;
