//! The examination of a machine: all findings, in the order of the output.

use crate::clocks::{clock_source, idle, stolen, timer, wake_up};
use crate::facts::Facts;
use crate::findings::Finding;
use crate::probe::{Probe, SystemState};
use crate::system::{
    budget, cores, governor, isolation, kernel, load, memory, preemption, priority, shared_memory,
};

/// All findings on a machine with these `facts` for runs at real-time priority `wanted`; `probe` if its wake-up was measured.
pub fn judge(facts: &Facts, around: &SystemState, probe: Option<&Probe>, wanted: u8) -> Vec<Finding> {
    let mut found = vec![
        kernel(facts),
        preemption(facts),
        priority(facts, wanted),
        memory(facts),
        budget(facts),
        cores(facts),
        load(facts),
        governor(facts),
        isolation(facts),
        shared_memory(around),
        timer(around),
        clock_source(facts),
        idle(facts, around, probe),
        stolen(facts, probe),
    ];
    found.extend(probe.map(wake_up));
    found
}

#[cfg(test)]
mod tests {
    use super::judge;
    use crate::facts::{Facts, MachineCpuTime};
    use crate::findings::{Level, Use, Verdict};
    use crate::probe::{Lateness, Probe, SystemState};

    fn good() -> (Facts, SystemState) {
        let facts = Facts {
            kernel: Some("6.12".to_owned()),
            build: Some("#1 SMP PREEMPT_RT".to_owned()),
            priority: Some(99),
            may_lock: Some(true),
            governors: vec!["performance".to_owned()],
            isolated: Some("2-3".to_owned()),
            tickless: Some("2-3".to_owned()),
            clock_source: Some("tsc".to_owned()),
            cores: Some(4),
            load: Some(0.1),
            cpu_time: Some(MachineCpuTime { stolen: 0, total: 1000 }),
            ..Facts::default()
        };
        let around = SystemState {
            shared_memory: "/dev/shm".into(),
            is_tmpfs: true,
            free: Some(1 << 30),
            resolution: 1,
            may_hold: true,
        };
        (facts, around)
    }

    type Spoil = fn(&mut Facts, &mut SystemState);

    #[test]
    fn each_fault_is_one_line_that_says_what_to_change_and_what_it_spoils() {
        let (facts, around) = good();
        assert!(judge(&facts, &around, None, 80).iter().all(|finding| finding.level == Level::Ok));
        let cases: [(&str, Option<Use>, Spoil); 17] = [
            ("preemption model", None, |f, _| f.build = Some("#1 SMP PREEMPT_DYNAMIC".to_owned())),
            ("preemption model", None, |f, _| f.build = Some("#1 SMP".to_owned())),
            ("real-time priority", Some(Use::Tails), |f, _| f.priority = Some(0)),
            ("real-time priority", Some(Use::Tails), |f, _| f.priority = Some(79)),
            ("locking memory", None, |f, _| f.may_lock = Some(false)),
            ("real-time budget", Some(Use::Tails), |f, _| f.realtime_share = Some(0.0)),
            ("cores", Some(Use::Medians), |f, _| f.cores = Some(1)),
            ("cores", None, |f, _| f.cores = Some(2)),
            ("cores", Some(Use::Tails), |f, _| f.quota = Some(1.5)),
            ("load", Some(Use::Medians), |f, _| f.load = Some(7.0)),
            ("frequency governor", None, |f, _| f.governors.push("powersave".to_owned())),
            ("isolated cores", None, |f, _| f.isolated = None),
            ("shared memory", Some(Use::Lockstep), |_, a| a.free = Some(4096)),
            ("shared memory", None, |_, a| a.is_tmpfs = false),
            ("timer resolution", Some(Use::Medians), |_, a| a.resolution = 4_000_000),
            ("clock source", Some(Use::Medians), |f, _| f.clock_source = Some("hpet".to_owned())),
            ("time stolen by the hypervisor", Some(Use::Tails), |f, _| {
                f.cpu_time = Some(MachineCpuTime { stolen: 2, total: 1000 });
            }),
        ];
        for (item, spoils, change) in cases {
            let (mut facts, mut around) = good();
            change(&mut facts, &mut around);
            let findings = judge(&facts, &around, None, 80);
            let bad: Vec<_> = findings.iter().filter(|finding| finding.level != Level::Ok).collect();
            assert_eq!((bad.len(), bad[0].item), (1, item));
            assert!(bad[0].remedy.as_ref().is_some_and(|remedy| !remedy.contains('\n')), "{item}");
            let expected = if spoils.is_some() { Level::Fail } else { Level::Warn };
            assert_eq!(bad[0].level, expected, "{item}");
            let verdict = Verdict::of(&findings);
            let held = [verdict.lockstep, verdict.medians, verdict.tails];
            let least = spoils.map_or(3, |spoils| spoils as usize);
            assert_eq!(held, [least > 0, least > 1, least > 2], "{item}: {}", verdict.words);
        }
    }

    #[test]
    fn what_was_measured_counts() {
        let (facts, around) = good();
        let late = |p50, p99| Lateness { p50, p99, max: 10 * p99 };
        let probe = Probe {
            scheduler: "SCHED_FIFO".to_owned(),
            seconds: 3.0,
            clock_cost: 30,
            asleep: late(41_000, 94_000),
            asleep_held: Some(late(4_600, 16_000)),
            spun: late(50, 140),
            stolen: 0,
            clock_ticks: 1200,
        };
        let levels = |probe: &Probe| {
            let findings = judge(&facts, &around, Some(probe), 80);
            let of = |item| findings.iter().find(|finding| finding.item == item).map(|finding| finding.level);
            ["idle states", "time stolen by the hypervisor", "wake-up"].map(|item| of(item).expect("a line"))
        };
        assert_eq!(levels(&probe), [Level::Warn, Level::Ok, Level::Ok]);
        let held_alike = Probe { asleep_held: Some(late(40_000, 90_000)), stolen: 3, ..probe.clone() };
        assert_eq!(levels(&held_alike), [Level::Ok, Level::Fail, Level::Ok], "nothing would change");
        let late_at_all = Probe { spun: late(300, 400_000), ..probe };
        assert_eq!(levels(&late_at_all)[2], Level::Fail);
    }
}
