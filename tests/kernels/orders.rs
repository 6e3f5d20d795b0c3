//! Orders of visible points: every point once, one mesh or cluster per workgroup, and k-means clusters that are more compact than
//! their initial runs.

use std::collections::HashMap;

use glam::DVec3;
use ppm_vk::internals::config::RenderConfig;
use ppm_vk::internals::gather;
use ppm_vk::internals::layout::{GROUP, NO_SLOT, VisiblePoint};
use ppm_vk::internals::sizes::Probe;
use ppm_vk::internals::stage::BufferId;

use super::bench::{Bench, object, small, xyz};

/// Visible points of `cornell-spheres`, in the order of a method.
fn order_of(method: &str) -> (Bench, Vec<VisiblePoint>, Vec<u32>) {
    let config = RenderConfig {
        resolution: [203, 101],
        ..small()
    };
    let mut bench = Bench::new("cornell-spheres", config);
    let method = gather::method(method).expect("a method");
    bench.renderer.gather(method, Probe::default()).expect("a gather");
    let points = bench.download(BufferId::VisiblePoints);
    let order = bench.download(BufferId::PointOrder);
    (bench, points, order)
}

/// Slots of each workgroup without fillers, up to the last point.
fn groups(order: &[u32]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = order
        .chunks(GROUP as usize)
        .map(|group| {
            let slots = group.iter().filter(|slot| **slot != NO_SLOT);
            slots.map(|&slot| slot as usize).collect()
        })
        .collect();
    while groups.last().is_some_and(Vec::is_empty) {
        groups.pop();
    }
    groups
}

fn assert_each_point_once(points: &[VisiblePoint], groups: &[Vec<usize>]) {
    let mut slots: Vec<usize> = groups.iter().flatten().copied().collect();
    slots.sort_unstable();
    let expected: Vec<usize> = (0..points.len())
        .filter(|&slot| object(points[slot].object).is_some())
        .collect();
    assert!(slots == expected, "{} slots, expected {}", slots.len(), expected.len());
}

fn assert_one_mesh_each(points: &[VisiblePoint], groups: &[Vec<usize>]) {
    for (index, group) in groups.iter().enumerate() {
        let mesh = |slot: &usize| object(points[*slot].object);
        assert!(!group.is_empty(), "group {index} has fillers alone");
        assert!(
            group.iter().all(|slot| mesh(slot) == mesh(&group[0])),
            "group {index} spans meshes"
        );
    }
}

#[test]
fn points_sorted_by_mesh_fill_all_but_the_last_workgroup_of_each_mesh() {
    let (_, points, order) = order_of("hitpoint-sort");
    let groups = groups(&order);
    assert_each_point_once(&points, &groups);
    assert_one_mesh_each(&points, &groups);
    let mut unfilled: HashMap<Option<u32>, usize> = HashMap::new();
    for group in groups.iter().filter(|group| group.len() < GROUP as usize) {
        *unfilled.entry(object(points[group[0]].object)).or_default() += 1;
    }
    assert!(
        unfilled.values().all(|&count| count == 1),
        "workgroups that aren't full, by mesh: {unfilled:?}"
    );
}

#[test]
fn clusters_have_workgroups_of_their_own_and_are_tighter_than_runs() {
    let (mut bench, points, order) = order_of("cluster");
    let clustered = groups(&order);
    assert_each_point_once(&points, &clustered);
    assert_one_mesh_each(&points, &clustered);
    let sizes: Vec<u32> = bench.download(BufferId::ClusterSizes);
    assert_eq!(
        sizes.iter().map(|&size| size.div_ceil(GROUP) as usize).sum::<usize>(),
        clustered.len(),
        "each cluster has whole workgroups"
    );
    assert_eq!(
        sizes.iter().map(|&size| size as usize).sum::<usize>(),
        clustered.iter().map(Vec::len).sum::<usize>(),
        "points of all clusters"
    );
    // The clusters begin with runs along the curve.
    let runs = groups(&bench.download::<u32>(BufferId::MeshOrder));
    let spread = |groups: &[Vec<usize>]| {
        let deviations = groups.iter().map(|group| {
            let positions: Vec<DVec3> = group.iter().map(|&slot| xyz(points[slot].position)).collect();
            let mean = positions.iter().sum::<DVec3>() / positions.len() as f64;
            positions.iter().map(|p| p.distance_squared(mean)).sum::<f64>()
        });
        deviations.sum::<f64>()
    };
    let (clusters, runs) = (spread(&clustered), spread(&runs));
    println!("sum of squared distances to the means: clusters {clusters}, runs {runs}");
    assert!(clusters < runs, "clusters {clusters}, runs {runs}");
}
