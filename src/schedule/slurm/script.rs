//! The input of `sbatch`: its arguments, and two short scripts.

use std::{
    ffi::{OsStr, OsString},
    path::Path,
};

use super::super::submission::Submission;

/// An element's request to the cluster.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Request {
    /// Options of `sbatch` with their values, such as `--partition=long`.
    pub options: Vec<String>,
    /// The most elements that run at a time.
    pub throttle: Option<usize>,
    /// Seconds before the time limit at which the elements are to stop.
    pub grace: u64,
}

/// The elements of a submission that form one array in the cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chunk {
    /// The first element.
    pub first: usize,
    /// The number of elements.
    pub count: usize,
    /// The most of them that run at a time.
    pub throttle: Option<usize>,
}

/// Divides `elements` into arrays of at most `most`. The arrays share the `throttle`; `None` where
/// there are more arrays than it allows elements.
pub fn chunks(elements: usize, most: usize, throttle: Option<usize>) -> Option<Vec<Chunk>> {
    let arrays = elements.div_ceil(most.max(1));
    if throttle.is_some_and(|throttle| throttle < arrays) {
        return None;
    }
    let chunk = |array: usize| {
        let first = array * most;
        // The first arrays, with the longest runs, get the remainder.
        let share = |throttle: usize| throttle / arrays + usize::from(array < throttle % arrays);
        Chunk {
            first,
            count: most.min(elements - first),
            throttle: throttle.map(share),
        }
    };
    Some((0..arrays).map(chunk).collect())
}

/// The script of an element; its first argument is the number of the first element in its array.
pub fn array(program: &Path, folder: &Path) -> Vec<u8> {
    let mut script = b"#!/bin/sh\n\
        # An element of mcpo-run: goes on with its runs from where they are, \
        and leaves in time for its limit.\n\
        exec "
        .to_vec();
    script.extend(quoted(program.as_os_str()));
    script.extend(b" worker --manifest ");
    script.extend(quoted(Submission::plan(folder).as_os_str()));
    script.extend(b" --index \"$((${1:-0} + SLURM_ARRAY_TASK_ID))\"\n");
    script
}

/// The script that writes the report with `arguments`, in `folder`.
pub fn collect(program: &Path, folder: &Path, arguments: &[OsString]) -> Vec<u8> {
    let mut script =
        b"#!/bin/sh\n# When all elements of mcpo-run have ended: the report.\ncd -- ".to_vec();
    script.extend(quoted(folder.as_os_str()));
    script.extend(b" || exit\nexec ");
    script.extend(quoted(program.as_os_str()));
    script.extend(b" report");
    for argument in arguments {
        script.push(b' ');
        script.extend(quoted(argument));
    }
    script.push(b'\n');
    script
}

/// The arguments of `sbatch` for the elements of `chunk` of the submission in `folder`.
pub fn sbatch_array(
    request: &Request,
    chunk: Chunk,
    experiment: &str,
    folder: &Path,
) -> Vec<OsString> {
    let throttle = chunk
        .throttle
        .map_or_else(String::new, |throttle| format!("%{throttle}"));
    let mut arguments = common(experiment, folder, "%A_%a");
    arguments.push(format!("--array=0-{}{throttle}", chunk.count - 1).into());
    arguments.push("--requeue".into());
    arguments.push(format!("--signal=B:USR1@{}", request.grace).into());
    arguments.extend(request.options.iter().map(OsString::from));
    arguments.push(joined(&[folder.as_os_str(), OsStr::new("/array.sh")]));
    arguments.push(chunk.first.to_string().into());
    arguments
}

/// The arguments of `sbatch` for the report, to be written when `jobs` have ended in any way.
pub fn sbatch_collect(
    request: &Request,
    jobs: &[String],
    experiment: &str,
    folder: &Path,
) -> Vec<OsString> {
    let mut arguments = common(experiment, folder, "report-%j");
    arguments.push(format!("--dependency=afterany:{}", jobs.join(":")).into());
    arguments.push("--requeue".into());
    arguments.extend(request.options.iter().map(OsString::from));
    arguments.push(joined(&[folder.as_os_str(), OsStr::new("/collect.sh")]));
    arguments
}

fn common(experiment: &str, folder: &Path, log: &str) -> Vec<OsString> {
    let id = folder.file_name().unwrap_or_default().to_string_lossy();
    let output = joined(&[
        OsStr::new("--output="),
        &literal(folder),
        OsStr::new(&format!("/log/{log}.txt")),
    ]);
    vec![
        "--parsable".into(),
        format!("--job-name={experiment}").into(),
        format!("--comment=mcpo:{experiment}/{id}").into(),
        output,
        "--open-mode=append".into(),
    ]
}

/// A path escaped so that `sbatch` replaces nothing in it.
fn literal(path: &Path) -> OsString {
    use std::os::unix::ffi::{OsStrExt, OsStringExt};
    let bytes = path.as_os_str().as_bytes();
    OsString::from_vec(
        bytes
            .iter()
            .flat_map(|&byte| {
                if byte == b'%' {
                    vec![b'%'; 2]
                } else {
                    vec![byte]
                }
            })
            .collect(),
    )
}

fn joined(parts: &[&OsStr]) -> OsString {
    parts.iter().fold(OsString::new(), |mut whole, part| {
        whole.push(part);
        whole
    })
}

/// `text` quoted as one word of a shell, whatever it contains.
pub fn quoted(text: &OsStr) -> Vec<u8> {
    use std::os::unix::ffi::OsStrExt;
    let mut word = b"'".to_vec();
    for &byte in text.as_bytes() {
        if byte == b'\'' {
            word.extend(br"'\''")
        } else {
            word.push(byte)
        }
    }
    word.push(b'\'');
    word
}

#[cfg(test)]
mod tests {
    use std::{os::unix::ffi::OsStrExt, process::Command};

    use super::*;

    const HOSTILE: [&str; 9] = [
        "it's",
        "a \"b\" c",
        "$(touch pwned)",
        "`touch pwned`",
        "two\nlines; touch pwned",
        "--wrap=x",
        "-rf",
        "\\' $HOME *",
        "100%j %A",
    ];

    #[test]
    fn a_shell_reads_a_quoted_word_as_it_was() {
        let folder = tempfile::tempdir().expect("a folder");
        for text in HOSTILE {
            let mut script = b"printf %s ".to_vec();
            script.extend(quoted(OsStr::new(text)));
            let mut shell = Command::new("sh");
            let output = shell
                .arg("-c")
                .arg(OsStr::from_bytes(&script))
                .current_dir(folder.path())
                .output()
                .expect("sh");
            assert_eq!(output.stdout, text.as_bytes());
        }
        assert!(!folder.path().join("pwned").exists());
    }

    #[test]
    fn an_element_starts_the_program_with_its_own_number_whatever_folders_are_called() {
        for text in HOSTILE {
            let folder = tempfile::tempdir().expect("a folder");
            let program = folder.path().join(text);
            std::fs::write(&program, "#!/bin/sh\nprintf '%s|' \"$@\"\n").expect("written");
            let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
            std::fs::set_permissions(&program, executable).expect("set");
            let submission = folder.path().join(format!("of {text}"));
            let script = folder.path().join("script");
            std::fs::write(&script, array(&program, &submission)).expect("written");
            let mut shell = Command::new("sh");
            shell
                .arg(&script)
                .arg("1000")
                .env("SLURM_ARRAY_TASK_ID", "7")
                .current_dir(folder.path());
            let said = String::from_utf8(shell.output().expect("sh").stdout).expect("text");
            let plan = submission.join("plan.jsonl");
            assert_eq!(
                said,
                format!("worker|--manifest|{}|--index|1007|", plan.display())
            );
            let collected = collect(&program, folder.path(), &["--".into(), text.into()]);
            std::fs::write(&script, collected).expect("written");
            let said =
                String::from_utf8(Command::new("sh").arg(&script).output().expect("sh").stdout)
                    .expect("text");
            assert_eq!(said, format!("report|--|{text}|"));
            assert!(!folder.path().join("pwned").exists());
        }
    }

    #[test]
    fn every_value_is_an_argument_of_its_own() {
        let request = Request {
            options: vec!["--partition=-x; $(y)".to_owned()],
            throttle: Some(4),
            grace: 120,
        };
        let chunk = Chunk {
            first: 1000,
            count: 8,
            throttle: Some(2),
        };
        let arguments = sbatch_array(&request, chunk, "e", Path::new("/a 100%/b"));
        let expected = [
            "--parsable",
            "--job-name=e",
            "--comment=mcpo:e/b",
            "--output=/a 100%%/b/log/%A_%a.txt",
            "--open-mode=append",
            "--array=0-7%2",
            "--requeue",
            "--signal=B:USR1@120",
            "--partition=-x; $(y)",
            "/a 100%/b/array.sh",
            "1000",
        ];
        assert_eq!(arguments, expected);
    }

    #[test]
    fn elements_are_shared_out_among_arrays_that_the_cluster_allows() {
        let chunk = |first, count, throttle| Chunk {
            first,
            count,
            throttle,
        };
        assert_eq!(chunks(3, 5, None), Some(vec![chunk(0, 3, None)]));
        let three = vec![
            chunk(0, 5, Some(4)),
            chunk(5, 5, Some(3)),
            chunk(10, 2, Some(3)),
        ];
        assert_eq!(chunks(12, 5, Some(10)), Some(three));
        assert_eq!(chunks(12, 5, Some(2)), None);
    }
}
