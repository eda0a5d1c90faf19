use std::sync::atomic::AtomicUsize;

use super::*;

fn bench() -> (tempfile::TempDir, RunPaths) {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = RunPaths::new(folder.path(), "e", "a/seed-0").expect("a good id");
    fs::create_dir_all(paths.claim.parent().expect("a folder")).expect("made");
    (folder, paths)
}

/// A claim that was left by `owner`, untouched for `silent`.
fn left_by(path: &Path, owner: &Owner, silent: Duration) {
    fs::write(path, owner.text()).expect("written");
    let file = File::options().write(true).open(path).expect("there");
    file.set_modified(SystemTime::now() - silent).expect("set");
}

fn files(paths: &RunPaths) -> usize {
    fs::read_dir(paths.claim.parent().expect("a folder"))
        .expect("readable")
        .count()
}

#[test]
fn a_claim_holds_others_off_until_it_is_dropped() {
    let (_folder, paths) = bench();
    assert!(!Claim::is_held(&paths).expect("no file is no claim"));
    let claim = Claim::take(&paths).expect("made").expect("free");
    assert!(
        Claim::take(&paths).expect("no error").is_none(),
        "claimed twice"
    );
    assert!(Claim::is_held(&paths).expect("readable") && !claim.is_lost());
    drop(claim);
    assert!(!Claim::is_held(&paths).expect("readable"));
    assert!(Claim::take(&paths).expect("no error").is_some());
    assert_eq!(files(&paths), 0, "something was left");
}

#[test]
fn a_process_that_died_here_holds_nobody_off() {
    let (_folder, paths) = bench();
    let mut child = std::process::Command::new("sleep")
        .arg("60")
        .spawn()
        .expect("it starts");
    let owner = Owner::process(child.id());
    left_by(&paths.claim, &owner, Duration::from_secs(3600));
    assert!(
        Claim::is_held(&paths).expect("readable"),
        "it lives, though it is silent"
    );
    assert!(Claim::take_now(&paths.claim).expect("no error").is_none());
    child.kill().and_then(|()| child.wait()).expect("it ends");
    assert!(!Claim::is_held(&paths).expect("readable"));
    let claim = Claim::take_now(&paths.claim)
        .expect("no error")
        .expect("free");
    assert!(
        Claim::take_now(&paths.claim).expect("no error").is_none(),
        "claimed twice"
    );
    drop(claim);
    assert_eq!(files(&paths), 0, "something was left");
}

#[test]
fn an_owner_on_another_machine_is_dead_when_it_has_been_silent_for_long() {
    let (_folder, paths) = bench();
    let elsewhere = Owner::elsewhere();
    left_by(&paths.claim, &elsewhere, SILENCE - Duration::from_secs(20));
    assert!(
        Claim::take_now(&paths.claim).expect("no error").is_none()
            && Claim::is_held(&paths).expect("readable")
    );
    left_by(&paths.claim, &elsewhere, SILENCE + Duration::from_secs(20));
    assert!(!Claim::is_held(&paths).expect("readable"));
    let claim = Claim::take_now(&paths.claim)
        .expect("no error")
        .expect("free");
    // The dead one's next sign of life changes nothing.
    left_by(&paths.claim, &elsewhere, Duration::ZERO);
    assert!(!claim.is_lost());
}

#[test]
fn whoever_is_taken_for_dead_knows_it_and_leaves_what_is_anothers() {
    let (_folder, paths) = bench();
    let claim = Claim::take(&paths).expect("made").expect("free");
    left_by(&claim.next, &Owner::elsewhere(), Duration::ZERO);
    assert!(claim.is_lost());
    drop(claim);
    assert_eq!(files(&paths), 2, "the other's claim was removed");
}

#[test]
fn of_many_that_find_a_dead_owner_one_gets_the_claim() {
    for round in 0..20 {
        let (_folder, paths) = bench();
        let dead = Owner::elsewhere();
        left_by(&paths.claim, &dead, 2 * SILENCE);
        left_by(
            &behind(&paths.claim, &dead),
            &Owner::elsewhere(),
            2 * SILENCE,
        );
        let (holders, had) = (AtomicUsize::new(0), AtomicUsize::new(0));
        thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let Some(_claim) = Claim::take(&paths).expect("no error") else {
                        return;
                    };
                    assert_eq!(
                        holders.fetch_add(1, Ordering::SeqCst),
                        0,
                        "two hold it, in round {round}"
                    );
                    had.fetch_add(1, Ordering::SeqCst);
                    thread::sleep(Duration::from_millis(3));
                    holders.fetch_sub(1, Ordering::SeqCst);
                });
            }
        });
        assert!(had.into_inner() >= 1);
        assert_eq!(files(&paths), 0, "something was left");
    }
}

#[cfg(unix)]
#[test]
fn what_lies_in_the_claims_place_and_is_none_is_left_alone() {
    let (folder, paths) = bench();
    let other = folder.path().join("other");
    fs::write(&other, "somebody's").expect("written");
    std::os::unix::fs::symlink(&other, &paths.claim).expect("linked");
    assert!(Claim::take(&paths).is_err() && Claim::is_held(&paths).is_err());
    fs::remove_file(&paths.claim).expect("there");
    fs::hard_link(&other, &paths.claim).expect("linked");
    let message = Claim::take(&paths).expect_err("no claim").to_string();
    assert!(message.contains("names no owner"), "{message}");
    assert_eq!(fs::read_to_string(&other).expect("readable"), "somebody's");
}
