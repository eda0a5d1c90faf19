//! Jobs as processes on this machine.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    io::{self, BufRead, BufReader, Read, Write},
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Stdio},
    sync::mpsc::{self, Receiver, Sender},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use super::{
    Executor,
    campaign::{self, Options, Summary},
    cost::CostModel,
    event::{Event, Job, Message},
    progress::{Progress, Style},
    state::Planned,
    stop::StopRequest,
};

/// On Linux, the running program itself, even if its file has been replaced or removed meanwhile.
const THIS_PROGRAM: &str = "/proc/self/exe";
/// The number of last lines of stderr that are kept of each process.
const STDERR_LINES: usize = 40;
/// The length at which a line of stderr is cut, bytes.
const STDERR_WIDTH: usize = 1000;

/// Runs `due` in processes of this machine until every run has ended, or a stop is asked for.
///
/// # Errors
///
/// This program's own file is gone.
pub fn run(
    due: &[Planned],
    results: &Path,
    options: Options,
    costs: &CostModel,
    stop: &StopRequest,
    progress: &mut Progress,
) -> io::Result<Summary> {
    Ok(campaign::run(
        due,
        results,
        options,
        costs,
        &mut LocalProcesses::new()?,
        stop,
        progress,
    ))
}

/// As [`run`], for runs that are seen for the first time: nothing is known of their speed.
///
/// # Errors
///
/// This program's own file is gone.
pub fn run_unknown(
    due: &[Planned],
    results: &Path,
    options: Options,
    style: Style,
    stop: &StopRequest,
) -> io::Result<Summary> {
    let costs = CostModel::default();
    let seconds = due.iter().map(|run| costs.seconds(&run.spec)).collect();
    let mut progress = Progress::new(style, options.verbose, seconds);
    run(due, results, options, &costs, stop, &mut progress)
}

/// An executor with one process per job.
#[derive(Debug)]
struct LocalProcesses {
    program: PathBuf,
    processes: BTreeMap<usize, Process>,
    sender: Sender<(usize, Told)>,
    receiver: Receiver<(usize, Told)>,
}

#[derive(Debug)]
struct Process {
    child: Child,
    stderr: JoinHandle<Vec<String>>,
    /// Whether its stdout has ended, as it does when the process ends.
    silent: bool,
}

#[derive(Debug)]
enum Told {
    Event(Event),
    End,
}

impl LocalProcesses {
    /// An executor that starts this very program, even if another is built meanwhile, so that a run
    /// is computed by the program that its stamp names. Systems other than Linux start whatever
    /// they find in the program's file.
    ///
    /// # Errors
    ///
    /// The program's file is gone.
    fn new() -> io::Result<Self> {
        let (sender, receiver) = mpsc::channel();
        let this = Path::new(THIS_PROGRAM);
        let program = if this.exists() {
            this.to_owned()
        } else {
            std::env::current_exe()?
        };
        Ok(Self {
            program,
            processes: BTreeMap::new(),
            sender,
            receiver,
        })
    }

    /// The number of a job whose process has ended since the last look, with its message.
    fn reap(&mut self) -> Option<(usize, Message)> {
        let ended = self
            .processes
            .iter_mut()
            .filter(|(_, process)| process.silent)
            .find_map(|(&number, process)| {
                let status = process.child.try_wait().transpose()?;
                Some((
                    number,
                    status.map_or_else(|error| format!("lost: {error}"), describe),
                ))
            });
        let (number, how) = ended?;
        let stderr = self
            .processes
            .remove(&number)?
            .stderr
            .join()
            .unwrap_or_default();
        Some((number, Message::Exited { how, stderr }))
    }
}

impl Executor for LocalProcesses {
    fn start(&mut self, number: usize, job: &Job) -> io::Result<()> {
        let mut line = serde_json::to_vec(job)?;
        line.push(b'\n');
        let mut command = Command::new(&self.program);
        // A program started through /proc would otherwise be called `exe` in lists of processes.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::arg0(&mut command, env!("CARGO_PKG_NAME"));
        let mut child = command
            .arg("worker")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let (Some(stdin), Some(stdout), Some(stderr)) =
            (&mut child.stdin, child.stdout.take(), child.stderr.take())
        else {
            unreachable!("all three pipes were asked for")
        };
        let sender = self.sender.clone();
        let listen = || {
            thread::Builder::new().spawn(move || pass_on(number, stdout, &sender))?;
            thread::Builder::new().spawn(move || last_lines(stderr))
        };
        let stderr = match listen() {
            Ok(stderr) => stderr,
            Err(error) => {
                // A process that nobody listens to would block once its pipes are full.
                child.kill().and_then(|()| child.wait())?;
                return Err(error);
            }
        };
        // If the worker is already dead, its exit reports that.
        let _ = stdin.write_all(&line).and_then(|()| stdin.flush());
        self.processes.insert(
            number,
            Process {
                child,
                stderr,
                silent: false,
            },
        );
        Ok(())
    }

    fn wait(&mut self, timeout: Duration) -> Option<(usize, Message)> {
        let until = Instant::now() + timeout;
        loop {
            if let Some(message) = self.reap() {
                return Some(message);
            }
            let pause = until
                .saturating_duration_since(Instant::now())
                .min(Duration::from_millis(20));
            match self.receiver.recv_timeout(pause) {
                Ok((number, Told::Event(event))) => return Some((number, Message::Event(event))),
                Ok((number, Told::End)) => {
                    if let Some(process) = self.processes.get_mut(&number) {
                        process.silent = true;
                    }
                }
                Err(_) if Instant::now() >= until => return None,
                Err(_) => {}
            }
        }
    }

    fn stop(&mut self, number: usize) {
        if let Some(process) = self.processes.get_mut(&number) {
            drop(process.child.stdin.take()); // its end is the message
        }
    }

    fn kill(&mut self, number: usize) {
        if let Some(process) = self.processes.get_mut(&number) {
            let _ = process.child.kill(); // fails when it is dead already
        }
    }
}

/// Passes on the events that job `number` writes to `stdout`, until that ends.
fn pass_on(number: usize, stdout: impl Read, sender: &Sender<(usize, Told)>) {
    for line in BufReader::new(stdout).split(b'\n').map_while(Result::ok) {
        // The physics engine may print too, so lines that are not events are ignored.
        let Ok(event) = serde_json::from_slice(&line) else {
            continue;
        };
        if sender.send((number, Told::Event(event))).is_err() {
            return;
        }
    }
    let _ = sender.send((number, Told::End)); // nobody listens any more when this fails
}

/// The number of cores that this process may use; two threads of one core count once.
pub fn physical_cores() -> usize {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |line: &str, name: &str| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == name).then(|| value.trim().to_owned())
    };
    let cores: BTreeSet<(String, String)> = text
        .split("\n\n")
        .filter_map(|processor| {
            let find = |name| processor.lines().find_map(|line| field(line, name));
            Some((find("physical id")?, find("core id")?))
        })
        .collect();
    // Threads are counted where the system does not tell the cores, and where this process may use
    // fewer threads than there are cores.
    if cores.is_empty() {
        threads
    } else {
        cores.len().min(threads)
    }
}

/// The last lines of a stream, read to its end.
fn last_lines(stream: impl Read) -> Vec<String> {
    let mut lines = VecDeque::new();
    let mut reader = BufReader::new(stream);
    let mut line = Vec::new();
    // An endless line must not fill the memory, so a longer one is read in pieces.
    while reader
        .by_ref()
        .take(STDERR_WIDTH as u64)
        .read_until(b'\n', &mut line)
        .is_ok_and(|read| read > 0)
    {
        if lines.len() == STDERR_LINES {
            lines.pop_front();
        }
        lines.push_back(String::from_utf8_lossy(&line).trim_end().to_owned());
        line.clear();
    }
    lines.into()
}

/// How a process ended, in words.
fn describe(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        let name = signal_hook::low_level::signal_name(signal).unwrap_or("an unknown signal");
        let hint = if name == "SIGKILL" {
            "; the system does this when memory runs out"
        } else {
            ""
        };
        return format!("killed by signal {signal} ({name}{hint})");
    }
    match status.code() {
        Some(101) => "panicked (exit code 101)".to_owned(),
        Some(code) => format!("exit code {code}"),
        None => status.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_lines_are_kept_however_long_they_are() {
        let many: String = (0..100).map(|n| format!("line {n}\n")).collect();
        let kept = last_lines(many.as_bytes());
        assert_eq!(
            (kept.len(), kept[0].as_str(), kept[39].as_str()),
            (40, "line 60", "line 99")
        );
        let endless = vec![b'x'; 1_000_000];
        assert!(
            last_lines(endless.as_slice())
                .iter()
                .all(|line| line.len() <= STDERR_WIDTH)
        );
        assert_eq!(last_lines(b"\xff no text".as_slice()), ["\u{fffd} no text"]);
    }

    #[test]
    fn what_is_no_event_is_passed_over_text_or_not() {
        let (sender, receiver) = mpsc::channel();
        let mut told = b"a warning\n\xff no text\n".to_vec();
        told.extend(serde_json::to_vec(&Event::Finished).expect("JSON"));
        pass_on(5, told.as_slice(), &sender);
        drop(sender);
        let passed: Vec<_> = receiver.into_iter().collect();
        assert!(
            matches!(
                passed.as_slice(),
                [(5, Told::Event(Event::Finished)), (5, Told::End)]
            ),
            "{passed:?}"
        );
    }
}
