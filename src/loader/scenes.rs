//! Chooses one of a file's scenes.

use gltf_json::{Root, Scene};

use super::diagnostic::{Check, damaged, label};
use crate::scene::{LoadChoice, Remark};
use crate::text::{list, quote};

/// Index of the scene: the one with the wanted name or, if none has it, number; otherwise the default scene. If that has no mesh,
/// or there is no default, the first scene with a mesh. `None`: the file has no scenes. `notes` get a line if there are several.
/// `parents` are those of all nodes, which form trees.
pub(crate) fn choose(
    root: &Root,
    parents: &[Option<usize>],
    wanted: Option<&str>,
    notes: &mut Vec<Remark>,
) -> Check<Option<usize>> {
    let scenes = &root.scenes;
    let names = || {
        let names: Vec<String> = scenes.iter().enumerate().map(named).collect();
        list(&names)
    };
    if let Some(wanted) = wanted {
        let by_name = scenes.iter().position(|scene| scene.name.as_deref() == Some(wanted));
        let by_number = || wanted.parse().ok().filter(|&index| index < scenes.len());
        return match by_name.or_else(by_number) {
            None if scenes.is_empty() => Err("it has no scenes to choose from; ask for none".into()),
            None => Err(format!(
                "no scene {}: the file has, by number and name, {}",
                quote(wanted),
                names()
            )),
            found => Ok(found),
        };
    }
    let default = root.scene.map(|scene| scene.value());
    if let Some(default) = default
        && default >= scenes.len()
    {
        return Err(damaged(format_args!(
            "its default scene is {default}, but it has {} scenes",
            scenes.len()
        )));
    }
    let shows = showing(root, parents);
    let shows_mesh = |index: usize| {
        let nodes = scenes.get(index).map_or(&[][..], |scene| &scene.nodes);
        nodes.iter().any(|node| shows.get(node.value()) == Some(&true))
    };
    let first = default.unwrap_or(0);
    let full = std::iter::once(first)
        .chain(0..scenes.len())
        .find(|&index| shows_mesh(index));
    let chosen = full.unwrap_or(first);
    if scenes.len() > 1 {
        let label = label("scene", chosen, scenes[chosen].name.as_deref());
        let why = match default {
            _ if chosen == first => "",
            Some(_) => ", since the default one shows no mesh,",
            None => ", the first that shows a mesh,",
        };
        let what = format!(
            "{label}{why} is rendered; the file has, by number and name, {}",
            names()
        );
        notes.push(Remark::with(LoadChoice::Scene, what));
    }
    Ok((!scenes.is_empty()).then_some(chosen))
}

/// `0 "name"`.
fn named((index, scene): (usize, &Scene)) -> String {
    match &scene.name {
        Some(name) => format!("{index} {}", quote(name)),
        None => index.to_string(),
    }
}

/// Which nodes have a mesh on or below them.
fn showing(root: &Root, parents: &[Option<usize>]) -> Vec<bool> {
    let mut shows = vec![false; root.nodes.len()];
    for (index, _) in root.nodes.iter().enumerate().filter(|(_, node)| node.mesh.is_some()) {
        let mut above = Some(index);
        while let Some(node) = above.filter(|&node| !shows[node]) {
            shows[node] = true;
            above = parents[node];
        }
    }
    shows
}
