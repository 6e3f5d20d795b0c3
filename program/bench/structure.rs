//! Statistics of the methods' structures: fillers, cluster sizes, photons per cell.

use serde::Serialize;

use ppm_vk::internals::config::pixel_of;
use ppm_vk::internals::error::Result;
use ppm_vk::internals::film::Image;
use ppm_vk::internals::layout::{GROUP, NO_SLOT, StatusCounters};
use ppm_vk::internals::pipeline::Renderer;
use ppm_vk::internals::stage::BufferId;

/// Order statistics of some counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Spread {
    /// Number of counts.
    pub number: usize,
    /// The smallest.
    pub min: u32,
    /// The middle one.
    pub median: u32,
    /// The largest.
    pub max: u32,
}

impl Spread {
    fn of(mut counts: Vec<u32>) -> Option<Self> {
        counts.sort_unstable();
        Some(Self {
            number: counts.len(),
            min: *counts.first()?,
            median: counts[counts.len() / 2],
            max: *counts.last()?,
        })
    }
}

/// Workgroups of visible points that have one mesh or cluster each.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Clusters {
    /// Share of fillers in the workgroups.
    pub filler_ratio: f64,
    /// Visible points per k-means cluster, excluding empty ones; `None` without clusters.
    pub sizes: Option<Spread>,
}

/// The structures that a method built.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Structure {
    /// Workgroups of visible points, if the method orders them.
    pub clusters: Option<Clusters>,
    /// Photons per cell, excluding empty ones, if the method has a grid.
    pub cell_photons: Option<Spread>,
    /// Photons beyond the user's maximum per cell.
    pub lost_photons: u32,
    /// Cells that had more than that maximum.
    pub full_cells: u32,
}

/// Reads the structures of the last gather from the device.
pub fn structure(renderer: &mut Renderer, method: &str, status: &StatusCounters) -> Result<Structure> {
    let ordered = method.starts_with("hitpoint-sort") || method.starts_with("cluster") && method != "clustered";
    let cells = match method {
        "cluster-grid" => Some((BufferId::ObjectCells, renderer.sizes().object_cells as usize)),
        "clustered" => Some((BufferId::CellStarts, 1 << renderer.sizes().cell_bits)),
        _ => None,
    };
    Ok(Structure {
        lost_photons: status.lost_photons,
        full_cells: status.full_cells,
        clusters: if ordered {
            Some(clusters(renderer, method.starts_with("cluster"))?)
        } else {
            None
        },
        cell_photons: match cells {
            Some((buffer, count)) => {
                let starts: Vec<u32> = renderer.gpu().download(buffer, Some(count + 1))?;
                let photons = starts.windows(2).map(|pair| pair[1] - pair[0]);
                Spread::of(photons.filter(|&photons| photons > 0).collect())
            }
            None => None,
        },
    })
}

fn clusters(renderer: &mut Renderer, by_k_means: bool) -> Result<Clusters> {
    let order: Vec<u32> = renderer.gpu().download(BufferId::PointOrder, None)?;
    let points = order.iter().filter(|slot| **slot != NO_SLOT).count();
    let used = order.chunks(GROUP as usize).filter(|group| group[0] != NO_SLOT).count();
    let sizes = if by_k_means {
        let sizes: Vec<u32> = renderer.gpu().download(BufferId::ClusterSizes, None)?;
        Spread::of(sizes.into_iter().filter(|&size| size > 0).collect())
    } else {
        None
    };
    Ok(Clusters {
        filler_ratio: 1.0 - points as f64 / (used * GROUP as usize).max(1) as f64,
        sizes,
    })
}

/// The paper's figure 3: each pixel in its cluster's colour, black where it has no visible point. The method `cluster`
/// must have gathered last.
///
/// # Errors
/// A failed Vulkan call.
pub fn cluster_picture(renderer: &mut Renderer) -> Result<Image> {
    let order: Vec<u32> = renderer.gpu().download(BufferId::PointOrder, None)?;
    let starts: Vec<u32> = renderer.gpu().download(BufferId::ClusterStarts, None)?;
    let sizes = *renderer.sizes();
    let [width, height] = sizes.region.size.map(|side| side as usize);
    let mut pixels = vec![[0.0; 3]; width * height];
    for (cluster, &start) in starts.iter().enumerate() {
        let end = starts.get(cluster + 1).map_or(order.len(), |&next| next as usize);
        for &slot in &order[start as usize..end] {
            if slot != NO_SLOT
                && let Some([x, y]) = pixel_of(sizes.region.size, slot / sizes.slots_per_pixel)
            {
                pixels[y as usize * width + x as usize] = color(cluster);
            }
        }
    }
    Ok(Image::new(width, height, pixels))
}

/// Distinct colours for neighbours: hues in steps of the golden ratio.
fn color(index: usize) -> [f32; 3] {
    let hue = (index as f64 * 0.618_033_988_75).fract() * 6.0;
    let channel = |offset: f64| {
        let distance = ((hue + offset) % 6.0 - 3.0).abs();
        (distance - 1.0).clamp(0.05, 0.8) as f32
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_has_the_extremes_and_the_middle() {
        let spread = Spread::of(vec![5, 1, 9, 2, 3]);
        assert_eq!(
            spread,
            Some(Spread {
                number: 5,
                min: 1,
                median: 3,
                max: 9
            })
        );
        assert_eq!(Spread::of(Vec::new()), None);
    }
}
