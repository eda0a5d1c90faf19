use super::*;
use crate::env::Task;

#[test]
fn an_unknown_name_is_refused_with_the_nearest_known_one() {
    for (name, expected) in [
        (
            "HalfCheetah-v4",
            "the known one is `HalfCheetah-v2`; v4 takes the same steps",
        ),
        (
            "Hopper-v5",
            "the known one is `Hopper-v2`; it is not the same: v5 pays no 1",
        ),
        (
            "Ant-v4",
            "the known one is `Ant-v2`; it is not the same: v4 observes 27",
        ),
        ("hopper-v2", "the nearest known one is `Hopper-v2`"),
        ("Walker-v2", "`Walker2d-v2`"),
        ("MountainCar-v1", "`MountainCar-v0`"),
        ("InvertedPendulm-v2", "`InvertedPendulum-v2`"),
        (
            "Humanoid-v4",
            "the known one is `Humanoid-v2`; it is not the same: v4 has no cost of contacts",
        ),
        (
            "CartPole-v1",
            "the known ones are `MountainCarContinuous-v0`, `InvertedPendulum-v2`",
        ),
        ("Pusher-v2", "the known ones are"),
        (
            "Swimmer-v4",
            "the known one is `Swimmer-v2`; v4 takes the same steps",
        ),
        ("", "the known ones are"),
    ] {
        let message = name.parse::<EnvId>().expect_err("unknown").to_string();
        assert!(
            message.contains(&format!("unknown environment `{name}`; "))
                && message.contains(expected),
            "{message}"
        );
    }
}

#[test]
fn gyms_names_and_the_papers_are_known() {
    for id in EnvId::shipped() {
        assert_eq!(id.name().parse::<EnvId>().ok(), Some(id));
        let text = serde_json::to_string(&id).expect("it can be written");
        assert_eq!(
            (text.as_str(), serde_json::from_str(&text).ok()),
            (&*format!("\"{id}\""), Some(id))
        );
    }
    for (name, id) in [
        ("MountainCar-v0", EnvId::MountainCar),
        ("Pendulum-v2", EnvId::InvertedPendulum),
        ("DoublePendulum-v2", EnvId::InvertedDoublePendulum),
    ] {
        assert_eq!(name.parse::<EnvId>().ok(), Some(id));
    }
}

#[test]
fn an_environment_has_its_own_sparse_reward_alone() {
    for id in EnvId::shipped() {
        for other in EnvId::shipped() {
            let reward = other.sparse_reward();
            let same =
                std::mem::discriminant(&reward) == std::mem::discriminant(&id.sparse_reward());
            match Task::new(id, reward, 10) {
                Ok(_) => assert!(same, "{id} takes {reward:?}"),
                Err(EnvError::NoSuchReward { .. }) => assert!(!same, "{id} refuses {reward:?}"),
                Err(error) => panic!("{error}"),
            }
        }
    }
}

#[test]
fn the_paper_s_are_where_they_are_said_to_be() {
    let names = EnvId::ALL.map(EnvId::name);
    let shipped: Vec<&str> = EnvId::shipped().map(EnvId::name).collect();
    assert_eq!(names[..], shipped[..7]);
    assert_eq!(
        (EnvId::Hopper.name(), EnvId::Ant.name()),
        ("Hopper-v2", "Ant-v2")
    );
}
