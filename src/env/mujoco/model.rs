//! A model's text, and the files beside it that it needs.
//!
//! The text is carried wherever its robot goes, so that a run is reproduced whatever has become of
//! the file. Meshes and textures, which may be large, stay where they are; their digests tell
//! whether they are still what they were.

use std::{
    borrow::Cow,
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::{
    env::Flaw,
    intake::{self, Links},
};

/// The longest text of a model that is read, bytes.
const LONGEST_TEXT: u64 = 1 << 24;
/// The longest mesh or texture that is read, bytes.
const LONGEST_FILE: u64 = 1 << 30;

/// A model in MJCF.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::env) struct Model {
    /// Its text.
    pub(super) text: Cow<'static, str>,
    /// The model's file; absent for one that ships, which needs no other file.
    pub(super) path: Option<PathBuf>,
    /// The digests of the files that it needs, by their names as the model gives them, with its
    /// folders in front.
    files: BTreeMap<PathBuf, String>,
}

impl Model {
    /// A model that ships.
    pub(in crate::env) const fn shipped(text: &'static str) -> Self {
        Self {
            text: Cow::Borrowed(text),
            path: None,
            files: BTreeMap::new(),
        }
    }

    /// The model in the file at `path`, with the files that it needs.
    ///
    /// # Errors
    ///
    /// The model, or a file that it names, cannot be read.
    pub(in crate::env) fn read(path: &Path) -> Result<Self, Flaw> {
        let unreadable = |path: &Path| {
            let path = path.to_owned();
            |source| Flaw::Unreadable { path, source }
        };
        let path = std::path::absolute(path).map_err(unreadable(path))?;
        let text = intake::read(&path, Links::Follow, LONGEST_TEXT).map_err(unreadable(&path))?;
        let text = String::from_utf8(text).map_err(|_| Flaw::NoText { path: path.clone() })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut files = BTreeMap::new();
        let mut waiting = needed(&text);
        while let Some(name) = waiting.pop() {
            let file = folder.join(&name);
            // A missing file is left to MuJoCo, which reports it with the line, if it needs it at
            // all.
            let Ok(bytes) = intake::read(&file, Links::Follow, LONGEST_FILE) else {
                continue;
            };
            let is_model = name
                .extension()
                .is_some_and(|extension| extension.eq_ignore_ascii_case("xml"));
            if files.insert(name, digest(&bytes)).is_none() && is_model {
                waiting.extend(needed(&String::from_utf8_lossy(&bytes)));
            }
        }
        Ok(Self {
            text: text.into(),
            path: Some(path),
            files,
        })
    }

    /// The model's identity: 16 hexadecimal digits of its text and the files that it needs,
    /// wherever they stand.
    pub(in crate::env) fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.text.as_bytes());
        for (name, digest) in &self.files {
            hasher.update(format!("\0{}\0{digest}", name.display()).as_bytes());
        }
        hasher.finalize().to_hex()[..16].to_owned()
    }

    /// # Errors
    ///
    /// A file that it needs has changed.
    pub(super) fn check_files(&self) -> Result<(), Flaw> {
        let folder = self
            .path
            .as_deref()
            .and_then(Path::parent)
            .unwrap_or(Path::new(""));
        for (name, was) in &self.files {
            let path = folder.join(name);
            let bytes = match intake::read(&path, Links::Follow, LONGEST_FILE) {
                Ok(bytes) => bytes,
                Err(source) => return Err(Flaw::Missing { path, source }),
            };
            if digest(&bytes) != *was {
                return Err(Flaw::Changed { path });
            }
        }
        Ok(())
    }
}

fn digest(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex()[..16].to_owned()
}

/// The files that the MJCF `text` may need: those that `file` attributes name, in each folder that
/// its compiler looks in.
fn needed(text: &str) -> Vec<PathBuf> {
    let attributes = attributes(text);
    let folders: Vec<&str> = attributes
        .iter()
        .filter(|(name, _)| ["assetdir", "meshdir", "texturedir"].contains(name))
        .map(|(_, value)| *value)
        .chain([""])
        .collect();
    let files = attributes
        .iter()
        .filter(|(name, value)| name.starts_with("file") && !value.is_empty());
    files
        .flat_map(|(_, file)| {
            folders
                .iter()
                .map(move |folder| Path::new(folder).join(file))
        })
        .collect()
}

/// The attributes of all elements of the XML `text`, without comments.
fn attributes(text: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some((_, inside)) = rest.split_once('<') {
        if let Some(comment) = inside.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        rest = inside;
        // Names and values alternate up to the end of the element.
        while let Some(at) = rest
            .find(['=', '>'])
            .filter(|at| rest.as_bytes()[*at] == b'=')
        {
            let name = rest[..at]
                .trim_end()
                .rsplit(char::is_whitespace)
                .next()
                .unwrap_or_default();
            let value = rest[at + 1..].trim_start();
            let Some(quote) = value.chars().next().filter(|c| ['"', '\''].contains(c)) else {
                break;
            };
            let Some((value, after)) = value[1..].split_once(quote) else {
                break;
            };
            found.push((name, value));
            rest = after;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_that_a_model_names_are_found_in_its_folders() {
        let text = "<mujoco><!-- <mesh file=\"old.stl\"/> --><compiler meshdir='meshes' angle=\"radian\"/>\n\
                    <include file=\"arm.xml\"/><asset><mesh name = \"a>b\" file = \"arm.stl\" />\n\
                    <texture fileright='right.png' type=\"cube\"/></asset></mujoco>";
        let expected = [
            "meshes/arm.xml",
            "arm.xml",
            "meshes/arm.stl",
            "arm.stl",
            "meshes/right.png",
            "right.png",
        ];
        assert_eq!(needed(text), expected.map(PathBuf::from));
        assert!(needed("<mujoco file=").is_empty() && needed("<!-- <mesh file='a'/>").is_empty());
    }

    #[test]
    fn a_digest_is_of_the_text_and_of_what_it_needs() {
        let shipped = Model::shipped("<mujoco/>");
        assert_eq!(shipped.digest(), blake3::hash(b"<mujoco/>").to_hex()[..16]);
        let mut other = shipped.clone();
        other.files.insert("a.stl".into(), "0".into());
        assert_ne!(other.digest(), shipped.digest());
    }
}
