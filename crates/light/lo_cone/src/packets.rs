use crate::{Cone, local_cone::LocalCone, steps::StepTable, tracer::ConeTracer};

/// Splits a list of cones into packets of consecutive cones with the same steps; skips those that miss the cube.
///
/// No iterator and no closures: code inlined into a function for one instruction set must not end up in one for
/// another.
pub(crate) struct Packets<'a> {
    tracer: &'a ConeTracer,
    cones: &'a [Cone],
    next: usize,
    table: Option<StepTable>,
    locals: Vec<LocalCone>,
    indices: Vec<usize>,
}

impl<'a> Packets<'a> {
    pub fn new(tracer: &'a ConeTracer, cones: &'a [Cone]) -> Self {
        Self { tracer, cones, next: 0, table: None, locals: Vec::new(), indices: Vec::new() }
    }

    /// Advances to the next packet of at most `MAX_CONES` cones; returns false at the end.
    #[inline(always)]
    pub fn next<const MAX_CONES: usize>(&mut self) -> bool {
        self.locals.clear();
        self.indices.clear();
        while self.locals.len() < MAX_CONES && self.next < self.cones.len() {
            let cone = &self.cones[self.next];
            if let Some(local) = LocalCone::new(cone, &self.tracer.cube, self.tracer.grid.side()) {
                let covers = self.table.as_ref().is_some_and(|table| {
                    table.covers(&self.tracer.settings, cone.tan_half_angle, local.near, local.far)
                });
                if !covers {
                    if !self.locals.is_empty() {
                        return true;
                    }
                    self.table = Some(self.tracer.steps(cone.tan_half_angle, &local));
                }
                self.locals.push(local);
                self.indices.push(self.next);
            }
            self.next += 1;
        }
        !self.locals.is_empty()
    }

    /// Returns the steps of the packet.
    #[inline(always)]
    pub fn table(&self) -> &StepTable {
        self.table.as_ref().expect("a packet has steps")
    }

    /// Returns the cones of the packet.
    #[inline(always)]
    pub fn cones(&self) -> &[LocalCone] {
        &self.locals
    }

    /// Returns the indices of the packet's cones in the list.
    #[inline(always)]
    pub fn indices(&self) -> impl Iterator<Item = usize> {
        self.indices.iter().copied()
    }
}
