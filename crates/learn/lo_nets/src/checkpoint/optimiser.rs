use super::{Checkpoint, CheckpointError, StoredTensor};
use crate::adam::{Adam, AdamMoments};

impl Checkpoint {
    /// Adds an optimiser's moments and step count under a name that no module has.
    pub fn add_adam(&mut self, name: &str, adam: &Adam) {
        // Two f32 parts hold any realistic step count exactly.
        let steps = vec![(adam.steps >> 16) as f32, (adam.steps & 0xffff) as f32];
        self.tensors.insert(format!("{name}.steps"), StoredTensor { shape: vec![2], values: steps });
        let betas = vec![adam.beta1, adam.beta2, adam.epsilon];
        self.tensors.insert(format!("{name}.constants"), StoredTensor { shape: vec![3], values: betas });
        for (parameter, AdamMoments { first, second }) in &adam.moments {
            for (kind, values) in [("first", first), ("second", second)] {
                let tensor = StoredTensor { shape: vec![values.len()], values: values.clone() };
                self.tensors.insert(format!("{name}.{kind}.{parameter}"), tensor);
            }
        }
    }

    /// Returns the optimiser stored under `name`.
    ///
    /// # Errors
    /// Names the values that are missing or inconsistent.
    pub fn load_adam(&self, name: &str) -> Result<Adam, CheckpointError> {
        let wrong = |what: String| CheckpointError::Weights { module: name.to_owned(), problems: vec![what] };
        let get = |key: &str| {
            let key = format!("{name}.{key}");
            self.tensors
                .get(&key)
                .map(|tensor| &tensor.values[..])
                .ok_or_else(|| wrong(format!("\"{key}\" is missing")))
        };
        let (&[high, low], &[beta1, beta2, epsilon]) = (get("steps")?, get("constants")?) else {
            return Err(wrong("\"steps\" and \"constants\" must have two and three values".to_owned()));
        };
        let mut adam = Adam { beta1, beta2, epsilon, steps: ((high as u64) << 16) + low as u64, ..Adam::default() };
        let prefix = format!("{name}.first.");
        for (key, first) in self.tensors.range(prefix.clone()..).take_while(|(key, _)| key.starts_with(&prefix)) {
            let parameter = &key[prefix.len()..];
            let second = get(&format!("second.{parameter}"))?.to_vec();
            if second.len() != first.values.len() {
                return Err(wrong(format!("the moments of \"{parameter}\" have different lengths")));
            }
            adam.moments.insert(parameter.to_owned(), AdamMoments { first: first.values.clone(), second });
        }
        Ok(adam)
    }
}
