//! Methods that a system that wraps another one takes from it unchanged.
//!
//! Most methods of [`SemiDiscrete`](super::SemiDiscrete) have a default, for bodies in which nothing breaks and no law has a history. A wrapper that left one out would have the
//! default in place of the answer of the body, so those that no wrapper changes stand here, once for all of them.

/// Methods that neither a displacement nor the terms beside a body change, handed on to the field `$system`.
macro_rules! body_of {
    ($system:ident) => {
        fn take_heat_work(&mut self) -> f64 {
            self.$system.take_heat_work()
        }

        fn rows_that_expand(&self, sites: &[u32]) -> $crate::system::BlockCsr {
            self.$system.rows_that_expand(sites)
        }

        fn seam_sites(&self) -> Vec<u32> {
            self.$system.seam_sites()
        }

        fn body_state(&self) -> Option<&dyn $crate::system::BodyState> {
            self.$system.body_state()
        }

        fn symmetry(&self) -> $crate::system::Symmetry {
            self.$system.symmetry()
        }
    };
}

/// Methods of the history of a body and of its broken bonds, handed on to the field `$system`.
macro_rules! state_of {
    ($system:ident) => {
        $crate::system::wrapped::body_of!($system);

        fn commit(&mut self) {
            self.$system.commit();
        }

        fn drag_rate_bound(&self) -> f64 {
            self.$system.drag_rate_bound()
        }

        fn dissipation(&self) -> Option<$crate::system::Dissipation> {
            self.$system.dissipation()
        }

        fn set_dissipation(&mut self, dissipation: $crate::system::Dissipation) {
            self.$system.set_dissipation(dissipation);
        }

        fn damage_state(&self) -> Vec<u64> {
            self.$system.damage_state()
        }

        fn restore_damage(&mut self, state: &[u64]) -> bool {
            self.$system.restore_damage(state)
        }
    };
}

/// Methods that take a displacement, handed on to the field `$system`, which has the same unknowns.
macro_rules! fields_of {
    ($system:ident) => {
        fn account_for_breaks(&mut self, at: &$crate::system::Halfway<'_>) {
            self.$system.account_for_breaks(at);
        }

        fn element_tangent(
            &self,
            u: &[f64],
            interval: $crate::system::Interval,
        ) -> Option<$crate::system::ElementTangent> {
            self.$system.element_tangent(u, interval)
        }

        fn round_off(&self, u: &[f64]) -> f64 {
            self.$system.round_off(u)
        }
    };
}

pub(crate) use {body_of, fields_of, state_of};
