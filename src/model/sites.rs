//! The sites of a model: nodes of finite elements, then peridynamic points.

use super::point_cloud::PointCloud;
use crate::{
    fem,
    model::{CellRole, Interface, Model, Site, SiteKind},
};

const NONE: u32 = u32::MAX;

impl<const D: usize> Model<D> {
    /// Makes sites of the nodes of finite elements; returns the site of each node.
    pub(crate) fn place_nodes(&mut self, interface: Interface) -> Vec<u32> {
        let mut element = vec![false; self.mesh.nodes.len()];
        let mut points = vec![false; self.mesh.nodes.len()];
        for c in 0..self.mesh.cell_count() {
            let flags = if self.roles[c] == CellRole::Points {
                &mut points
            } else {
                &mut element
            };
            for &n in self.mesh.cell(c) {
                flags[n as usize] = true;
            }
        }
        let own = (0..self.mesh.cell_count()).filter(|&c| self.node_takes(c));
        let mut volumes = fem::nodal_volumes(&self.mesh, own);
        for n in 0..volumes.len() as u32 {
            for &(tied, weight) in self.ties.followers(n) {
                volumes[n as usize] += weight * volumes[tied as usize];
            }
        }
        let mut node_site = vec![NONE; self.mesh.nodes.len()];
        for n in 0..self.mesh.nodes.len() {
            let constrained = interface.constrained.is_some() && points[n];
            let tied = self.ties.followed(n as u32).is_some();
            if element[n] && !constrained && !tied {
                node_site[n] = self.sites.len() as u32;
                self.sites.push(Site {
                    position: self.mesh.nodes[n],
                    kind: SiteKind::Node(n as u32),
                    volume: volumes[n],
                });
            }
        }
        node_site
    }

    /// Makes sites of the points that follow no element; returns the site of each point.
    pub(crate) fn place_point_sites(&mut self, cloud: &PointCloud<D>) -> Vec<u32> {
        let mut point_site = vec![NONE; cloud.position.len()];
        for (i, carrier) in cloud.carrier.iter().enumerate() {
            if carrier.is_own() {
                point_site[i] = self.sites.len() as u32;
                self.sites.push(Site {
                    position: cloud.position[i],
                    kind: SiteKind::Point(i as u32),
                    volume: cloud.volume[i],
                });
            }
        }
        point_site
    }
}
