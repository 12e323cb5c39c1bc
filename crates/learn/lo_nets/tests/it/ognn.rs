//! Tests layers on dual octree graphs against `ognn` 1.x by their first author (`golden/make_graph.py`).

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use lo_geometry::{Cube, Vec3};
use lo_nets::graph::GraphLevel;
use lo_nets::layers::{DownSample, Head, ResBlock, UpSample};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use safetensors::SafeTensors;

const GOLDEN: &[u8] = include_bytes!("golden/graph.safetensors");

struct Golden {
    file: SafeTensors<'static>,
    device: Device,
}

impl Golden {
    fn floats(&self, name: &str) -> Vec<f32> {
        let bytes = self.file.tensor(name).unwrap().data();
        bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
    }

    fn tensor(&self, name: &str) -> Tensor<2> {
        let shape = self.file.tensor(name).unwrap().shape().to_vec();
        Tensor::from_data(TensorData::new(self.floats(name), [shape[0], shape[1]]), &self.device)
    }

    fn load(&self, parameter: &mut Param<Tensor<2>>, name: &str) {
        let value = self.tensor(name);
        assert_eq!(parameter.dims(), value.dims(), "{name}");
        *parameter = Param::from_tensor(value);
    }

    fn check(&self, name: &str, got: Tensor<2>) {
        let (got, expected): (Vec<f32>, _) = (got.inner().into_data().iter().collect(), self.floats(name));
        assert_eq!(got.len(), expected.len(), "{name}");
        let largest = expected.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        let error = got.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, |a, b| if b <= a { a } else { b });
        println!("{name}: {error:.2e} of {largest:.2e}");
        assert!(error <= 1e-4 * largest, "{name}: {error} of {largest}");
    }
}

#[test]
fn block_pooling_and_head_are_those_of_ognn() {
    let golden = Golden { file: SafeTensors::deserialize(GOLDEN).unwrap(), device: Device::flex().autodiff() };
    let points: Vec<RadiancePoint> = golden
        .floats("points")
        .as_chunks::<3>()
        .0
        .iter()
        .map(|&p| RadiancePoint { position_m: Vec3::from(p), radiance: [1.0; 3], provenance: Provenance::Observed })
        .collect();
    let cube = Cube { origin_m: Vec3::NEG_ONE, edge_m: 2.0 };
    let levels = GraphLevel::all(&LightOctree::from_points(&points, cube, 5, 2).unwrap().0.octree);
    let finest = &levels[3];

    let (stream, device) = (&mut lo_random::stream(1, "test", 0), &golden.device);
    let mut block = ResBlock::new([8, 4], 4, 1, stream, device);
    golden.load(&mut block.first.weights, "block.first");
    golden.load(&mut block.first_norm.affine, "block.first_norm");
    golden.load(&mut block.second.weights, "block.second");
    golden.load(&mut block.second_norm.affine, "block.second_norm");
    let mut down = DownSample::new([8, 12], 1, stream, device);
    golden.load(&mut down.weights, "down.weights");
    golden.load(&mut down.projection.linear.weights, "down.linear");
    golden.load(&mut down.projection.norm.affine, "down.norm");
    let mut up = UpSample::new([12, 8], 1, stream, device);
    golden.load(&mut up.weights, "up.weights");
    golden.load(&mut up.projection.linear.weights, "up.linear");
    golden.load(&mut up.projection.norm.affine, "up.norm");
    let mut head = Head::new([8, 6], &[0.0; 2], 1, stream, device);
    golden.load(&mut head.hidden.linear.weights, "head.hidden");
    golden.load(&mut head.hidden.norm.affine, "head.norm");
    golden.load(&mut head.output.weights, "head.output");
    golden.load(head.output.bias.as_mut().unwrap(), "head.bias");

    let input = golden.tensor("input").require_grad();
    let blocked = block.forward(input.clone(), finest);
    golden.check("blocked", blocked.clone());
    let downed = down.forward(blocked, finest);
    golden.check("downed", downed.clone());
    let upped = up.forward(downed, finest);
    golden.check("upped", upped.clone());
    let headed = head.forward(upped);
    golden.check("headed", headed.clone());

    let gradients = (headed * golden.tensor("output_gradient")).sum().backward();
    golden.check("input_gradient", input.grad(&gradients).unwrap());
    golden.check("block.first.gradient", block.first.weights.grad(&gradients).unwrap());
    golden.check("down.gradient", down.weights.grad(&gradients).unwrap());
    golden.check("up.gradient", up.weights.grad(&gradients).unwrap());
}
