//! Slurm's answers about jobs, in its own words and in ours.

use std::collections::HashMap;

use super::{SlurmError, call};

/// Slurm's row on an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Its state, such as `RUNNING`.
    pub state: String,
    /// The wait status that it ended with; 0 before its end, and where Slurm does not say.
    pub status: u32,
    /// The nodes; empty where it waits.
    pub nodes: String,
    /// Why it waits, or why it ended as it did.
    pub reason: String,
}

/// The stage of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// It has not begun, or begins again.
    Waits,
    /// It is under way.
    Runs,
    /// It has ended.
    Ended,
}

impl Row {
    /// The stage that the element's state belongs to.
    pub fn stage(&self) -> Stage {
        match self.state.as_str() {
            "PENDING" | "REQUEUED" | "REQUEUE_HOLD" | "REQUEUE_FED" | "SPECIAL_EXIT"
            | "RESV_DEL_HOLD" => Stage::Waits,
            "RUNNING" | "CONFIGURING" | "COMPLETING" | "SUSPENDED" | "STOPPED" | "STAGE_OUT"
            | "SIGNALING" | "RESIZING" => Stage::Runs,
            _ => Stage::Ended,
        }
    }

    /// How it ended, as part of a sentence: `Slurm calls its job FAILED (exit code 7, on n1)`.
    pub fn ending(&self) -> String {
        let how = match (self.status >> 8 & 0xff, self.status & 0x7f) {
            (0, 0) => "exit code 0".to_owned(),
            (code, 0) => format!("exit code {code}"),
            (_, signal) => {
                let name = i32::try_from(signal)
                    .ok()
                    .and_then(signal_hook::low_level::signal_name);
                format!(
                    "signal {signal}{}",
                    name.map_or_else(String::new, |name| format!(" {name}"))
                )
            }
        };
        let nodes = if self.nodes.is_empty() {
            String::new()
        } else {
            format!(", on {}", self.nodes)
        };
        let reason = if self.reason.is_empty() || self.reason == "None" {
            ""
        } else {
            &self.reason
        };
        let reason = if reason.is_empty() {
            String::new()
        } else {
            format!(", {reason}")
        };
        format!("Slurm calls its job {} ({how}{nodes}{reason})", self.state)
    }
}

/// The rows that Slurm still has on `jobs`, by job and index in the array. Slurm's controller
/// forgets ended jobs after some minutes; its accounting, where there is one, keeps them longer.
///
/// # Errors
///
/// Slurm is not there, or does not answer.
pub fn rows(jobs: &[String]) -> Result<HashMap<(String, usize), Row>, SlurmError> {
    let mut rows = HashMap::new();
    for jobs in jobs.chunks(500) {
        let list = jobs.join(",");
        // The reason comes last, since it may contain any text.
        let format = "ArrayJobID:|,ArrayTaskID:|,State:|,exit_code:|,NodeList:|,Reason:|";
        match call(
            "squeue",
            &["-h", "-r", "-t", "all", "-j", list.as_str(), "-O", format],
        ) {
            Ok(text) => rows.extend(text.lines().filter_map(queued)),
            // Slurm says this when it has forgotten all of the jobs.
            Err(SlurmError::Refused { said, .. }) if said.contains("Invalid job id") => {}
            Err(error) => return Err(error),
        }
        let accounted = call(
            "sacct",
            &[
                "-n",
                "-X",
                "-P",
                "-j",
                &list,
                "-o",
                "JobID,State,ExitCode,NodeList,Reason",
            ],
        );
        // Many clusters have no accounting.
        for (element, row) in accounted
            .unwrap_or_default()
            .lines()
            .filter_map(accounted_for)
        {
            rows.entry(element).or_insert(row);
        }
    }
    Ok(rows)
}

/// A line of `squeue`.
fn queued(line: &str) -> Option<((String, usize), Row)> {
    let mut fields = line.splitn(6, '|').map(str::trim);
    let mut next = || Some(fields.next()?.to_owned());
    let element = (next()?, next()?.parse().ok()?);
    let (state, status, nodes) = (next()?, next()?.parse().unwrap_or(0), next()?);
    let reason = next()?.trim_end_matches('|').to_owned();
    Some((
        element,
        Row {
            state,
            status,
            nodes,
            reason,
        },
    ))
}

/// A line of `sacct`: `12_3|CANCELLED by 0|0:15|n1|None`.
fn accounted_for(line: &str) -> Option<((String, usize), Row)> {
    let fields: Vec<&str> = line.split('|').map(str::trim).collect();
    let [job, state, exit, nodes, reason] = fields[..] else {
        return None;
    };
    let (job, index) = job.split_once('_')?;
    let (code, signal) = exit.split_once(':')?;
    let status = code.parse::<u32>().ok()? << 8 | signal.parse::<u32>().ok()?;
    let nodes = if nodes.starts_with("None") { "" } else { nodes };
    let state = state.split(' ').next()?.to_owned();
    let row = Row {
        state,
        status,
        nodes: nodes.to_owned(),
        reason: reason.to_owned(),
    };
    Some(((job.to_owned(), index.parse().ok()?), row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_queue_and_of_the_accounting_are_read() {
        let row = |state: &str, status, nodes: &str, reason: &str| Row {
            state: state.to_owned(),
            status,
            nodes: nodes.to_owned(),
            reason: reason.to_owned(),
        };
        let element = |job: &str, index| (job.to_owned(), index);
        // As Slurm 22.05 writes them.
        let read = queued("1|1|FAILED|1792|n2|NonZeroExitCode|");
        assert_eq!(
            read,
            Some((
                element("1", 1),
                row("FAILED", 1792, "n2", "NonZeroExitCode")
            ))
        );
        let read = queued("1|2|PENDING|0||Resources|");
        assert_eq!(
            read,
            Some((element("1", 2), row("PENDING", 0, "", "Resources")))
        );
        assert_eq!(
            queued("4|N/A|PENDING|0||Dependency|"),
            None,
            "no element of an array"
        );
        let read = accounted_for("12_3|CANCELLED by 0|0:15|n1|None");
        assert_eq!(
            read,
            Some((element("12", 3), row("CANCELLED", 15, "n1", "None")))
        );
        assert_eq!(
            accounted_for("12_[4-9]|PENDING|0:0|None assigned|None"),
            None
        );
    }

    #[test]
    fn an_end_is_told_with_its_code_or_its_signal() {
        let row = |state: &str, status| Row {
            state: state.to_owned(),
            status,
            nodes: "n1".into(),
            reason: "None".into(),
        };
        assert_eq!(
            row("COMPLETED", 0).ending(),
            "Slurm calls its job COMPLETED (exit code 0, on n1)"
        );
        assert_eq!(
            row("FAILED", 1792).ending(),
            "Slurm calls its job FAILED (exit code 7, on n1)"
        );
        assert_eq!(
            row("NODE_FAIL", 9).ending(),
            "Slurm calls its job NODE_FAIL (signal 9 SIGKILL, on n1)"
        );
        assert_eq!(row("RUNNING", 0).stage(), Stage::Runs);
        assert_eq!(
            (row("PENDING", 0).stage(), row("TIMEOUT", 9).stage()),
            (Stage::Waits, Stage::Ended)
        );
    }
}
