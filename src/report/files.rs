//! The files of a report, and the removal of an earlier report's leftovers.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use crate::record::{self, RecordError};

/// A folder of files that keeps a list of their names, so that a later report can remove those that
/// it no longer writes.
pub struct Files {
    folder: PathBuf,
    /// The files, in order.
    pub written: Vec<PathBuf>,
}

impl Files {
    /// The file that keeps the names, one per line.
    const LIST: &str = ".files";
    /// The extensions of the files of a report.
    const EXTENSIONS: [&str; 7] = ["md", "tex", "csv", "png", "svg", "pdf", "html"];

    /// Starts an empty list in `folder`, which is created.
    ///
    /// # Errors
    ///
    /// The folder is a link, or the disk refuses.
    pub fn in_folder(folder: PathBuf) -> Result<Self, RecordError> {
        refuse_link(&folder)?;
        fs::create_dir_all(&folder).map_err(|source| RecordError::Io {
            action: "create",
            path: folder.clone(),
            source,
        })?;
        Ok(Self {
            folder,
            written: Vec::new(),
        })
    }

    /// Writes `folder/name.extension`.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn write(&mut self, name: &str, extension: &str, bytes: &[u8]) -> Result<(), RecordError> {
        let path = self.folder.join(format!("{name}.{extension}"));
        record::write_atomically(&path, bytes)?;
        self.written.push(path);
        Ok(())
    }

    /// Writes a table in all formats: Markdown, LaTeX (bare and as a float), and CSV.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn table(
        &mut self,
        name: &str,
        markdown: &str,
        [bare, float]: [String; 2],
        csv: &[u8],
    ) -> Result<(), RecordError> {
        self.write(name, "md", markdown.as_bytes())?;
        self.write(name, "tex", bare.as_bytes())?;
        self.write(&format!("{name}-float"), "tex", float.as_bytes())?;
        self.write(name, "csv", csv)
    }

    /// Removes the files of an earlier report that this one has not written, and keeps the names of
    /// those that it has.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn close(&self) -> Result<(), RecordError> {
        let list = self.folder.join(Self::LIST);
        let names: BTreeSet<String> = self
            .written
            .iter()
            .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
            .collect();
        // The list may come from anywhere, so a name that leads elsewhere or is no report's is
        // ignored.
        let report = |name: &str| {
            let extension = Path::new(name)
                .extension()
                .and_then(|extension| extension.to_str());
            !name.contains(['/', '\\'])
                && extension.is_some_and(|extension| Self::EXTENSIONS.contains(&extension))
        };
        let before = fs::read_to_string(&list).unwrap_or_default();
        for name in before
            .lines()
            .filter(|name| report(name) && !names.contains(*name))
        {
            let path = self.folder.join(name);
            if let Err(source) = fs::remove_file(&path)
                && source.kind() != std::io::ErrorKind::NotFound
            {
                return Err(RecordError::Io {
                    action: "remove",
                    path,
                    source,
                });
            }
        }
        let names: String = names.iter().map(|name| format!("{name}\n")).collect();
        record::write_atomically(&list, names.as_bytes())
    }
}

/// # Errors
///
/// `folder` is a link to somewhere else.
pub fn refuse_link(folder: &Path) -> Result<(), RecordError> {
    if folder.is_symlink() {
        let reason = "it is a link, and what it leads to might be overwritten".to_owned();
        return Err(RecordError::Malformed {
            path: folder.to_owned(),
            expected: "a folder to write a report into",
            reason,
        });
    }
    Ok(())
}
