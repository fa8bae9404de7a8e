//! Lines of very many points, thinned out to what can be seen.

use super::drawing::Point;

/// The same line with at most four points to a pixel across: where it enters, its lowest, its highest, where it leaves.
pub(super) fn thin(points: Vec<Point>) -> Vec<Point> {
    let across = points.last().zip(points.first()).map_or(0.0, |(last, first)| last.0 - first.0);
    if (points.len() as f64) < across.max(1.0) * 4.0 {
        return points;
    }
    let mut thinned = Vec::new();
    for column in points.chunk_by(|left, right| same_pixel(left.0, right.0)) {
        let places = [Some(0), extreme(column, f64::min), extreme(column, f64::max), Some(column.len() - 1)];
        let mut places: Vec<usize> = places.into_iter().flatten().collect();
        places.sort_unstable();
        places.dedup();
        thinned.extend(places.into_iter().filter_map(|place| column.get(place)));
    }
    thinned
}

#[allow(clippy::float_cmp, reason = "both are whole")]
fn same_pixel(left: f64, right: f64) -> bool {
    left.floor() == right.floor()
}

/// Where the lowest or the highest point of a column is.
#[allow(clippy::float_cmp, reason = "it is one of them")]
fn extreme(column: &[Point], farther: impl Fn(f64, f64) -> f64) -> Option<usize> {
    let extreme = column.iter().map(|point| point.1).reduce(farther)?;
    column.iter().position(|point| point.1 == extreme)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_with_few_points_stays_as_it_is() {
        let points: Vec<Point> = (0..100).map(|n| (f64::from(n), f64::from(n % 7))).collect();
        assert_eq!(thin(points.clone()), points);
    }

    #[test]
    fn every_peak_stays_however_many_points_there_are() {
        let height = |n: u32| if n == 54_321 { 99.0 } else { f64::from(n % 3) };
        let points: Vec<Point> = (0..100_000).map(|n| (f64::from(n) / 1000.0, height(n))).collect();
        let thinned = thin(points.clone());
        assert!(thinned.len() <= 400, "{}", thinned.len());
        assert!(thinned.contains(&points[54_321]));
        assert_eq!((thinned.first(), thinned.last()), (points.first(), points.last()));
        assert!(thinned.is_sorted_by(|left, right| left.0 <= right.0));
    }
}
