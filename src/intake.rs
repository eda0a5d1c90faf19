//! Files that may come from strangers: regular ones alone, and no more of them than is expected.
//!
//! A folder of results may hold a pipe where a table is expected, which would never end, a device
//! that has no end, or a link to a file elsewhere. Owns how a file is opened and how much of it is
//! read; knows nothing of what is in it.

use std::{
    fs::{File, Metadata, OpenOptions},
    io::{self, Read},
    path::Path,
};

/// How to treat a path whose last part is a link to another file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Links {
    /// Follow it: somebody named this path.
    Follow,
    /// Refuse it: the path was found in a folder that somebody else may have made.
    Refuse,
}

/// The whole content of the regular file `path`.
///
/// # Errors
///
/// The file is missing, a refused link, not a regular file, or longer than `limit` bytes.
pub(crate) fn read(path: &Path, links: Links, limit: u64) -> io::Result<Vec<u8>> {
    let file = open(path, links, OpenOptions::new().read(true))?;
    let mut bytes = Vec::new();
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(invalid(format!(
            "it has more than {limit} bytes, which is the most that is read"
        )));
    }
    Ok(bytes)
}

/// Opens the regular file `path` with `options`.
///
/// # Errors
///
/// The system refuses, or it is a refused link or not a regular file.
pub(crate) fn open(path: &Path, links: Links, options: &OpenOptions) -> io::Result<File> {
    let mut options = options.clone();
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        let flags = rustix::fs::OFlags::NONBLOCK; // opening a pipe waits for whoever writes to it
        let no_follow = if links == Links::Refuse {
            rustix::fs::OFlags::NOFOLLOW
        } else {
            rustix::fs::OFlags::empty()
        };
        options.custom_flags((flags | no_follow).bits() as i32);
    }
    let file = match options.open(path) {
        Err(_) if links == Links::Refuse && path.is_symlink() => {
            return Err(invalid(
                "it is a link to another file, and links are not followed there".to_owned(),
            ));
        }
        opened => opened?,
    };
    check(&file.metadata()?)?;
    Ok(file)
}

fn check(metadata: &Metadata) -> io::Result<()> {
    let what = if metadata.is_dir() {
        "a folder"
    } else {
        "a device, a pipe or the like"
    };
    if metadata.is_file() {
        Ok(())
    } else {
        Err(invalid(format!("it is {what}, not a file")))
    }
}

fn invalid(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, reason)
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use std::{fs, os::unix::fs::symlink};

    use super::*;

    fn refusal(path: &Path, links: Links) -> String {
        read(path, links, 8).expect_err("refused").to_string()
    }

    #[test]
    fn what_is_no_regular_file_is_refused_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .expect("mkfifo is there");
        assert!(made.success());
        for links in [Links::Follow, Links::Refuse] {
            assert!(refusal(&pipe, links).contains("a pipe"));
            assert!(refusal(Path::new("/dev/zero"), links).contains("a device"));
            assert!(refusal(folder.path(), links).contains("a folder"));
            assert_eq!(
                read(&folder.path().join("none"), links, 8)
                    .expect_err("missing")
                    .kind(),
                io::ErrorKind::NotFound
            );
        }
    }

    #[test]
    fn links_are_followed_where_somebody_named_them_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "content").expect("written");
        symlink(&file, &link).expect("linked");
        assert_eq!(read(&link, Links::Follow, 8).expect("readable"), b"content");
        assert!(refusal(&link, Links::Refuse).contains("a link"));
        let append = OpenOptions::new().append(true).create(true).clone();
        assert!(open(&link, Links::Refuse, &append).is_err());
        let nowhere = folder.path().join("nowhere");
        symlink(folder.path().join("new"), &nowhere).expect("linked");
        assert!(
            open(&nowhere, Links::Refuse, &append).is_err() && !folder.path().join("new").exists()
        );
        fs::write(&file, "nine bytes").expect("written");
        assert!(refusal(&link, Links::Follow).contains("more than 8 bytes"));
    }
}
