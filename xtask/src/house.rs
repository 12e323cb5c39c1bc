//! The packages of the workspace, as `cargo metadata` tells them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use serde::Deserialize;

/// The checkout.
pub struct House {
    /// Its folder.
    pub root: PathBuf,
    /// Its packages.
    pub packages: Vec<Package>,
}

/// A package, and which packages of the house it knows.
#[derive(Debug, Default)]
pub struct Package {
    pub name: String,
    /// From the checkout's folder, with slashes.
    pub folder: String,
    /// Libraries, programs, tests, benches and examples.
    pub targets: Vec<Target>,
    /// By dependencies and build dependencies, those of features too.
    pub knows: BTreeSet<String>,
    /// By dependencies of its tests, benches and examples alone.
    pub knows_in_tests: BTreeSet<String>,
    /// Names other than their own under which it knows packages of the house.
    pub renamed: BTreeSet<String>,
}

/// What cargo builds of a package.
#[derive(Debug, Deserialize)]
pub struct Target {
    pub name: String,
    /// `lib`, `bin`, `test`, `bench` or `example`, in most cases one.
    pub kind: Vec<String>,
    /// Whether `cargo test` compiles the code in its documentation.
    #[serde(default)]
    pub doctest: bool,
}

impl House {
    /// The checkout that this program was built from.
    pub fn read() -> anyhow::Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the checkout")?.to_owned();
        let text = cargo(&root, &["metadata", "--no-deps", "--offline", "--format-version", "1"])?;
        let packages = packages(&text, &root)?;
        Ok(Self { root, packages })
    }

    /// Documents, sources and configurations, by their paths from the checkout's folder.
    pub fn texts(&self) -> anyhow::Result<BTreeMap<String, String>> {
        let mut texts = BTreeMap::new();
        let mut folders = vec![self.root.clone()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))? {
                let (path, name) =
                    entry.map(|entry| (entry.path(), entry.file_name().to_string_lossy().into_owned()))?;
                // Links lead out of the house; `target` and `out` are not in it.
                let is_link = path.is_symlink() || name.starts_with('.');
                if path.is_dir() && !is_link && !["target", "out"].contains(&name.as_str()) {
                    folders.push(path);
                } else if [".md", ".rs", ".toml"].iter().any(|end| name.ends_with(end)) && !is_link {
                    let text =
                        std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
                    let path = path.strip_prefix(&self.root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
                    texts.insert(path, text);
                }
            }
        }
        Ok(texts)
    }
}

impl Package {
    /// Whether it has a target of a kind.
    pub fn has(&self, kind: &str, name: &str) -> bool {
        self.targets.iter().any(|target| target.name == name && target.kind.iter().any(|has| has == kind))
    }
}

/// What cargo prints in a folder.
pub fn cargo(folder: &Path, args: &[&str]) -> anyhow::Result<String> {
    let program = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(program).current_dir(folder).args(args).output().context("cannot run cargo")?;
    ensure!(output.status.success(), "cargo {}: {}", args.join(" "), String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).context("what cargo prints is not UTF-8")
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Raw>,
}

#[derive(Deserialize)]
struct Raw {
    name: String,
    manifest_path: PathBuf,
    targets: Vec<Target>,
    dependencies: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    kind: Option<String>,
    rename: Option<String>,
    path: Option<PathBuf>,
}

fn packages(metadata: &str, root: &Path) -> anyhow::Result<Vec<Package>> {
    let metadata: Metadata = serde_json::from_str(metadata)?;
    metadata.packages.into_iter().map(|raw| package(raw, root)).collect()
}

fn package(raw: Raw, root: &Path) -> anyhow::Result<Package> {
    let folder = raw.manifest_path.parent().and_then(|folder| folder.strip_prefix(root).ok());
    let folder = folder.with_context(|| format!("{} lies outside of the checkout", raw.name))?;
    let folder = folder.to_string_lossy().replace('\\', "/");
    // Who has a path is of the house.
    let ours = || raw.dependencies.iter().filter(|dependency| dependency.path.is_some());
    let of_kind = |tests: bool| ours().filter(move |known| (known.kind.as_deref() == Some("dev")) == tests);
    let knows: BTreeSet<_> = of_kind(false).map(|known| known.name.clone()).collect();
    let knows_in_tests = of_kind(true).map(|known| known.name.clone()).filter(|name| !knows.contains(name)).collect();
    let renamed = ours().filter_map(|known| known.rename.clone()).collect();
    Ok(Package { name: raw.name, folder, targets: raw.targets, knows, knows_in_tests, renamed })
}
