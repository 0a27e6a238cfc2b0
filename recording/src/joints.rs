//! Pairing the joints of a recording with those of an arm by name.

use thiserror::Error;

use crate::guess::words_of;
use crate::names::{Group, list};
use crate::recording::Recording;
use crate::table::JOINTS_KEY;

/// Reason why the joints of a recording cannot be paired with those of an arm.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum JointsError {
    /// Some joints have a counterpart, others have none.
    #[error(
        "{file}: no joint named {missing}; it has {found}, and the arm has {wanted}: give the model of this arm, or name the joints with joints = […] in a mapping or with --joints when importing"
    )]
    NoSuchJoint {
        /// The recording.
        file: String,
        /// The joints of the arm without a counterpart.
        missing: String,
        /// The joints of the recording.
        found: String,
        /// The joints of the arm.
        wanted: String,
    },
    /// A requested joint does not exist, or its name fits several joints.
    #[error(
        "{file}: the name {missing} identifies no single joint; the recording has {found}: give each joint by its name, or by a part of it that no other name has"
    )]
    NotAsked {
        /// The recording.
        file: String,
        /// The requested name.
        missing: String,
        /// The joints of the recording.
        found: String,
    },
    /// The joints have no names, and the number of requested names differs from theirs.
    #[error(
        "{file}: its joints have no names, so that {missing} can't be found; it has {found}: give a name for each of these columns, in this order, or choose some of them"
    )]
    Nameless {
        /// The recording.
        file: String,
        /// The requested names.
        missing: String,
        /// Columns of the joints.
        found: String,
    },
    /// A joint requested twice.
    #[error("{file}: {first} and {second} both select the joint {joint}; give each joint once")]
    AskedTwice {
        /// The recording.
        file: String,
        /// The joint.
        joint: String,
        /// The first request.
        first: String,
        /// The later request.
        second: String,
    },
}

/// A comparison of the words of two names.
type Like = fn(&[String], &[String]) -> bool;

/// Index in `found` of each of `wanted`: by the whole name, else by a part that no other name has (`shoulder_pan` of `ur5e_shoulder_pan_joint`, or the other
/// way round). The word "joint" does not count.
pub(crate) fn places(wanted: &[String], found: &[String]) -> Vec<Option<usize>> {
    let wanted_words: Vec<Vec<String>> = wanted.iter().map(|name| essential(name)).collect();
    let found_words: Vec<Vec<String>> = found.iter().map(|name| essential(name)).collect();
    let mut places: Vec<Option<usize>> =
        wanted.iter().map(|name| found.iter().position(|other| other == name)).collect();
    let like: [Like; 2] = [|a, b| a == b, |a, b| holds(a, b) || holds(b, a)];
    for is_like in like {
        let taken = places.clone();
        let free = |place: &usize| !taken.contains(&Some(*place));
        for (index, words) in wanted_words.iter().enumerate().filter(|(index, _)| taken[*index].is_none()) {
            let mut candidates =
                (0..found.len()).filter(free).filter(|&place| is_like(words, &found_words[place]));
            let (Some(only), None) = (candidates.next(), candidates.next()) else { continue };
            // The match must be unique among the wanted joints, too.
            let others = wanted_words.iter().enumerate().filter(|(other, _)| taken[*other].is_none());
            if others.filter(|(_, words)| is_like(words, &found_words[only])).count() == 1 {
                places[index] = Some(only);
            }
        }
    }
    places
}

/// The words of a joint's name without "joint".
fn essential(name: &str) -> Vec<String> {
    words_of(name).into_iter().filter(|word| word != "joint" && word != "joints").collect()
}

/// True if `whole` contains the words of `part` in sequence.
fn holds(whole: &[String], part: &[String]) -> bool {
    !part.is_empty() && whole.windows(part.len()).any(|window| window == part)
}

impl Recording {
    /// The recording with its joints in the order of the joints `wanted` of an arm. Pairs them by name if it has names; by number if it has none, or none like
    /// those of the arm, with a note. Drops joints that the arm lacks, with a note.
    ///
    /// # Errors
    /// [`JointsError`] if the recording has only some of the joints.
    pub fn for_joints(mut self, wanted: &[String]) -> Result<Self, JointsError> {
        if self.joint_names.is_empty() {
            self.notes.push("joints are paired by number: the recording has no names of joints".to_owned());
            return Ok(self);
        }
        let places = places(wanted, &self.joint_names);
        if places.iter().all(Option::is_none) {
            self.notes.push(format!(
                "joints are paired by number: none of the recording's ({}) has a name like one of the arm's ({})",
                list(&self.joint_names),
                list(wanted)
            ));
            return Ok(self);
        }
        let Some(order) = places.iter().copied().collect::<Option<Vec<usize>>>() else {
            let missing = wanted.iter().zip(&places).filter(|(_, place)| place.is_none());
            return Err(JointsError::NoSuchJoint {
                file: self.origin.display().to_string(),
                missing: missing.map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", "),
                found: list(&self.joint_names),
                wanted: list(wanted),
            });
        };
        let extra: Vec<String> = (0..self.joints())
            .filter(|joint| !order.contains(joint))
            .map(|joint| self.joint_names[joint].clone())
            .collect();
        if order.iter().enumerate().any(|(joint, place)| joint != *place) {
            let named: Vec<String> = order.iter().map(|&place| self.joint_names[place].clone()).collect();
            self.notes.push(format!("joints are paired by name: q1…q{} are {}", order.len(), list(&named)));
        }
        if !extra.is_empty() {
            self.notes.push(format!("joints that the model lacks are left out: {}", list(&extra)));
        }
        self.reorder(&order);
        Ok(self)
    }

    /// The recording with the joints `asked` alone, in this order, each given by its name or a part that no other name has. Joints without names are given by
    /// their columns, `q1` and on; if the request names all of them, they get these names. A note lists the dropped joints.
    ///
    /// # Errors
    /// [`JointsError`] for a joint that does not exist or is requested twice.
    pub fn only_joints(mut self, asked: &[String]) -> Result<Self, JointsError> {
        let file = self.origin.display().to_string();
        let columns: Vec<String> = (0..self.joints()).map(|joint| Group::Position.column(joint)).collect();
        let has_names = !self.joint_names.is_empty();
        let found = if has_names { self.joint_names.clone() } else { columns };
        let places = places(asked, &found);
        if !has_names && places.iter().all(Option::is_none) && asked.len() == found.len() {
            self.notes.push(format!(
                "joints get the requested names in the order of their columns: {}",
                list(asked)
            ));
            self.name_joints(asked.to_vec());
            return Ok(self);
        }
        let Some(order) = places.iter().copied().collect::<Option<Vec<usize>>>() else {
            let missing =
                asked.iter().zip(&places).filter(|(_, place)| place.is_none()).map(|(name, _)| name.as_str());
            let (missing, found) = (missing.collect::<Vec<_>>().join(", "), list(&found));
            return Err(match has_names {
                true => JointsError::NotAsked { file, missing, found },
                false => JointsError::Nameless { file, missing, found },
            });
        };
        for (index, place) in order.iter().enumerate() {
            if let Some(earlier) = order[..index].iter().position(|other| other == place) {
                let (first, second) = (asked[earlier].clone(), asked[index].clone());
                return Err(JointsError::AskedTwice { file, joint: found[*place].clone(), first, second });
            }
        }
        let left: Vec<String> = (0..found.len())
            .filter(|joint| !order.contains(joint))
            .map(|joint| found[joint].clone())
            .collect();
        if !left.is_empty() {
            self.notes.push(format!("joints that were not requested are left out: {}", list(&left)));
        }
        self.joint_names = found;
        self.reorder(&order);
        Ok(self)
    }

    /// Keeps the joints at the indices `order`, in that order.
    fn reorder(&mut self, order: &[usize]) {
        fn taken<T: Clone>(columns: &[T], order: &[usize]) -> Vec<T> {
            order.iter().map(|&place| columns[place].clone()).collect()
        }
        self.name_joints(taken(&self.joint_names, order));
        self.q = taken(&self.q, order);
        self.q_link = taken(&self.q_link, order);
        for group in [&mut self.qd, &mut self.tau, &mut self.q_ref].into_iter().flatten() {
            *group = taken(group, order);
        }
        if let Some(sources) = &mut self.sources {
            sources.reorder(order);
        }
    }

    /// Names the joints `names`, also in the metadata, where files keep the names.
    fn name_joints(&mut self, names: Vec<String>) {
        let written = names.join(",");
        match self.metadata.iter_mut().find(|(key, _)| key == JOINTS_KEY) {
            Some((_, old)) => *old = written,
            None => {
                self.metadata.push((JOINTS_KEY.to_owned(), written));
                self.metadata.sort();
            }
        }
        self.joint_names = names;
    }
}

#[cfg(test)]
mod tests {
    use super::places;

    fn of(wanted: &[&str], found: &[&str]) -> Vec<Option<usize>> {
        let owned = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        places(&owned(wanted), &owned(found))
    }

    #[test]
    fn names_are_matched_whole_or_by_a_part_that_is_unique() {
        let ur =
            ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint", "wrist_1_joint", "wrist_2_joint"];
        let all = [Some(2), Some(1), Some(0), Some(3), Some(4)];
        let wanted =
            ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint"];
        assert_eq!(of(&wanted, &ur), all);
        assert_eq!(of(&wanted.map(|name| format!("ur5e_{name}")).each_ref().map(String::as_str), &ur), all);
        assert_eq!(of(&["shoulder_pan", "lift", "elbow", "wrist_1", "2"], &ur), all);
        assert_eq!(of(&["joint_1", "joint_2"], &["panda_joint2", "panda_joint1"]), [Some(1), Some(0)]);
        assert_eq!(of(&["shoulder"], &ur), [None], "two are meant");
        assert_eq!(
            of(&["joint1", "joint2"], &["left/joint1", "right/joint1", "left/joint2"]),
            [None, Some(2)]
        );
    }
}
