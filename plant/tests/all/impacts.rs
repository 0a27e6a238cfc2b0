//! Impacts of the journal: the paper's arm against a high-accuracy integration, and one impact alone.

use crate::common::{chain, close, near, paper, rod, system};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathSpec};
use freeplay_plant::{Input, System, SystemError};

/// Steps the driven arm by single sub-steps and records \[time, speed, peak force, depth\] of its first contacts.
fn first_contacts(step: f64, count: usize) -> Vec<[f64; 4]> {
    let arm = paper_arm().arm;
    let path = JointPath::plan(&arm, &PathSpec::default(), 1000.0).expect("the smooth path");
    let mut system = system(&arm, &[(4, paper(0.2e-3))], step, 1);
    let (mut q, mut v, mut a) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]);
    path.at(0.0, &mut q, &mut v, &mut a);
    system.start(&q, &v);
    let input = Input { torque: &[0.0; 6], driven: &[true; 6], motion: &path };
    let (mut contacts, mut was): (Vec<[f64; 4]>, bool) = (Vec::new(), false);
    while contacts.len() < count || was {
        system.tick(&input).expect("finite");
        let touching = system.bearings()[0].touching();
        if touching && !was {
            system.bearing_mut(0).take_peak();
            contacts.push([system.time() - 0.5 * step, system.bearings()[0].impact_speed(), 0.0, 0.0]);
        }
        if was
            && !touching
            && let Some(last) = contacts.last_mut()
        {
            last[2] = system.bearing_mut(0).take_peak();
        }
        was = touching;
    }
    contacts
}

#[test]
fn the_first_six_impacts_agree_with_the_high_accuracy_series() {
    let events: Vec<serde_json::Value> =
        serde_json::from_str(include_str!("data/radau_first60ms.json")).expect("oracle");
    let number = |event: &serde_json::Value, index: usize| event[index].as_f64().expect("number");
    let contacts: Vec<_> = events.iter().filter(|event| event[0] == "contact").take(6).collect();
    let releases: Vec<_> = events.iter().filter(|event| event[0] == "release").take(6).collect();
    assert_eq!(releases.len(), 6);
    for (index, ours) in first_contacts(2e-5, 6).iter().enumerate() {
        near(&format!("impact {} time", index + 1), ours[0], number(contacts[index], 1), 0.01);
        near(&format!("impact {} speed", index + 1), ours[1], number(contacts[index], 2), 0.01);
        near(&format!("impact {} peak force", index + 1), ours[2], number(releases[index], 3), 0.01);
    }
}

#[test]
fn smaller_steps_come_closer_to_the_series() {
    let peak = |step: f64| first_contacts(step, 1)[0][2];
    let errors: Vec<f64> = [4e-5, 1e-5, 2.5e-6].map(|step| (peak(step) / 1106.3954 - 1.0).abs()).to_vec();
    println!("peak force errors at 40, 10, 2.5 us: {errors:?}");
    assert!(errors[2] < errors[1].max(1e-5) && errors[2] < 2e-4);
}

#[test]
fn one_impact_returns_what_lankarani_and_nikravesh_return() {
    let mass = 2.22;
    let arm = chain(vec![rod("joint", mass, 0.115, 0.0)], 0.0);
    let mut system = system(&arm, &[(0, paper(0.2e-3))], 1e-7, 1);
    system.start(&[0.0], &[0.0]);
    // The journal moves along the rod, so that the rod does not turn.
    system.place_journal(0, [0.2e-3 - 1e-9, 0.0], [0.062_641_8, 0.0]);
    let hold = freeplay_plant::Braking::new(vec![1.0]);
    let input = Input { torque: &[0.0], driven: &[true], motion: &hold };
    let mut touched = false;
    for _ in 0..10_000 {
        system.tick(&input).expect("finite");
        let touching = system.bearings()[0].touching();
        if touched && !touching {
            break;
        }
        touched |= touching;
    }
    let tally = system.tallies().next().expect("one play");
    close("restitution", -system.v()[system.play().plays()[0].slides[0]] / 0.062_641_8, 0.913_177, 1e-4);
    near("peak force", tally.peak_normal_force, 1076.325, 1e-4);
    near("depth", tally.peak_penetration, 9.31874e-6, 1e-4);
    close("duration", tally.impact, 0.458_349e-3, 3e-7);
    assert_eq!((tally.contacts, tally.impacts), (1, 1));
}

#[test]
fn a_step_that_cannot_resolve_a_contact_is_refused() {
    let arm = paper_arm().arm;
    let play = |plays: &[_]| freeplay_laws::ArmWithPlay::new(&arm, plays).expect("an arm");
    let refused = System::new(play(&[(4, paper(0.2e-3))]), &arm, 1e-3, 9);
    assert!(matches!(refused, Err(SystemError::StepTooLong { .. })));
    assert!(System::new(play(&[(4, paper(0.2e-3))]), &arm, 1e-3, 10).is_ok());
    assert!(System::new(play(&[]), &arm, 1e-3, 1).is_ok(), "without play there is nothing to resolve");
    assert!(matches!(System::new(play(&[]), &arm, 1e-3, 0), Err(SystemError::NoStep { .. })));
}
