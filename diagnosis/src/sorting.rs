//! Sorting by numbers. The standard library compiles its sort anew for each comparison: a tenth of the time that the compiler spent on this crate. Here one
//! instance serves every list.

/// Sorts `values`, the least first.
pub(crate) fn sort(values: &mut [f64]) {
    values.sort_by(f64::total_cmp);
}

/// The indices of `values` in rising order; equal values keep their order.
pub(crate) fn rising_order(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<(f64, usize)> = values.iter().copied().zip(0..).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.into_iter().map(|(_, index)| index).collect()
}

/// Sorts `items` by their `value`, the least first; equal ones keep their order.
pub(crate) fn sort_rising<T>(items: &mut Vec<T>, value: impl Fn(&T) -> f64) {
    let values: Vec<f64> = items.iter().map(value).collect();
    let mut unsorted: Vec<Option<T>> = items.drain(..).map(Some).collect();
    items.extend(rising_order(&values).into_iter().filter_map(|index| unsorted[index].take()));
}

/// Sorts `items` by their `value`, the greatest first; equal ones keep their order.
pub(crate) fn sort_falling<T>(items: &mut Vec<T>, value: impl Fn(&T) -> f64) {
    sort_rising(items, |item| -value(item));
}

#[cfg(test)]
mod tests {
    use super::{sort_falling, sort_rising};

    #[test]
    fn equal_items_keep_their_order() {
        let all =
            || vec![('a', 1.0), ('b', f64::NEG_INFINITY), ('c', 1.0), ('d', -0.5), ('e', f64::INFINITY)];
        let (mut rising, mut falling) = (all(), all());
        sort_rising(&mut rising, |item| item.1);
        sort_falling(&mut falling, |item| item.1);
        let names = |items: &[(char, f64)]| items.iter().map(|item| item.0).collect::<String>();
        assert_eq!((names(&rising), names(&falling)), ("bdace".into(), "eacdb".into()));
    }
}
