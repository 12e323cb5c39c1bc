use lo_geometry::Vec3;
use lo_insert::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    if a[1] == "crop" {
        let c: Vec<usize> = a[4].split(',').map(|x| x.parse().unwrap()).collect();
        let im = lo_imaging::read_photo(&a[2]).unwrap().photo;
        let lo_imaging::Photo::Srgb8(im) = im else { panic!() };
        let im = lo_imaging::Image::from_fn(c[2] * c[4], c[3] * c[4], |i, j| im[(c[0] + i / c[4], c[1] + j / c[4])]);
        lo_imaging::write_photo(&a[3], &lo_imaging::Photo::Srgb8(im), "x").unwrap();
        return;
    }
    if a[1] == "side" {
        let ims: Vec<_> = a[3..]
            .iter()
            .map(|p| match lo_imaging::read_photo(p).unwrap().photo {
                lo_imaging::Photo::Srgb8(i) => i,
                _ => panic!(),
            })
            .collect();
        let (w, h) = (ims[0].width(), ims[0].height());
        let im = lo_imaging::Image::from_fn(w * ims.len(), h, |x, y| ims[x / w][(x % w, y)]);
        lo_imaging::write_photo(&a[2], &lo_imaging::Photo::Srgb8(im), "x").unwrap();
        return;
    }
    let scene = lo_scene::Scene::read(std::path::Path::new(&a[1])).unwrap();
    let mut model = lo_mesh::Model::load(std::path::Path::new(&a[2]), &Default::default()).unwrap();
    if a[3] != "-" {
        model.override_material(&lo_mesh::MaterialSpec::parse(&a[3]).unwrap(), std::path::Path::new(".")).unwrap();
    }
    let model = lo_mesh::PreparedModel::new(model);
    let scale = a[4].parse::<f32>().unwrap() / model.bounds().size().y;
    let n: Vec<f64> = a[5][1..].split(',').map(|x| x.parse().unwrap()).collect();
    let yaw = a[6].parse::<f32>().unwrap().to_radians();
    let align = match a[7].as_str() {
        "surface" => Align::Surface,
        "none" => Align::None,
        _ => Align::Gravity,
    };
    let base = Base::new(&model);
    let place = if a[5].starts_with('p') {
        let p = Placement::rest_on_pixel(&scene, n[0], n[1], align).unwrap().scaled(scale).turned(yaw);
        let q = p.settled(&scene, &base);
        eprintln!("at {} up {} moved {}", q.position_m, q.up, (q.position_m - p.position_m).dot(p.up));
        if a[7] == "surface" { p } else { q }
    } else {
        Placement::at(&scene, Vec3::new(n[0] as f32, n[1] as f32, n[2] as f32), align).scaled(scale).turned(yaw)
    };
    let quality = match a[8].as_str() {
        "draft" => Quality::Draft,
        "high" => Quality::High,
        _ => Quality::Normal,
    };
    let t = std::time::Instant::now();
    let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
    eprintln!("new {:?}", t.elapsed());
    let c = inserter
        .render(&model, &place, &mut |e| {
            match &e {
                lo_events::Event::Done { stage, took } => eprintln!("{stage:?} {took:?}"),
                lo_events::Event::Warning(w) => eprintln!("WARN {w:?}"),
                _ => {}
            }
            std::ops::ControlFlow::Continue(())
        })
        .unwrap();
    let crop: Vec<usize> = a.get(10).map_or(vec![], |s| s.split(',').map(|x| x.parse().unwrap()).collect());
    let cropped = |im: lo_imaging::Photo| match (im, crop.as_slice()) {
        (lo_imaging::Photo::Srgb8(im), &[x, y, w, h, z]) => {
            lo_imaging::Photo::Srgb8(lo_imaging::Image::from_fn(w * z, h * z, |i, j| im[(x + i / z, y + j / z)]))
        }
        (im, _) => im,
    };
    lo_imaging::write_photo(&a[9], &cropped(c.image), "x").unwrap();
}
