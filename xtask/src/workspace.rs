//! The packages of the workspace as `cargo metadata` lists them, and its texts.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use serde::Deserialize;

/// The checkout.
pub struct Workspace {
    /// Its folder.
    pub root: PathBuf,
    /// Its packages.
    pub packages: Vec<Package>,
}

/// A package, and the packages of the workspace that it depends on.
#[derive(Debug, Default)]
pub struct Package {
    pub name: String,
    /// Relative to the checkout, with slashes.
    pub folder: String,
    /// Libraries, programs, tests, benches and examples.
    pub targets: Vec<Target>,
    /// Dependencies and build dependencies, optional ones included.
    pub dependencies: BTreeSet<String>,
    /// Dependencies of tests, benches and examples alone.
    pub dev_dependencies: BTreeSet<String>,
    /// Names by which dependencies are renamed.
    pub renamed: BTreeSet<String>,
    /// Dependencies from outside of the workspace that accept any version.
    pub wildcards: BTreeSet<String>,
    /// Whether `cargo publish --workspace` publishes it.
    pub is_published: bool,
}

/// A target that cargo builds.
#[derive(Debug, Default, Deserialize)]
pub struct Target {
    pub name: String,
    /// `lib`, `bin`, `test`, `bench` or `example`; in most cases one.
    pub kind: Vec<String>,
    /// The root module's file, absolute.
    #[serde(default)]
    pub src_path: PathBuf,
    /// Whether `cargo test` compiles the code in its documentation.
    #[serde(default)]
    pub doctest: bool,
}

impl Workspace {
    /// The checkout that this program was built from.
    pub fn read() -> anyhow::Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask is not in a checkout")?.to_owned();
        let text = cargo(&root, &["metadata", "--no-deps", "--offline", "--format-version", "1"])?;
        let packages = packages(&text, &root)?;
        Ok(Self { root, packages })
    }

    /// Markdown, Rust and TOML files by their paths relative to the checkout.
    pub fn texts(&self) -> anyhow::Result<BTreeMap<String, String>> {
        let mut texts = BTreeMap::new();
        let mut folders = vec![self.root.clone()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))? {
                let (path, name) =
                    entry.map(|entry| (entry.path(), entry.file_name().to_string_lossy().into_owned()))?;
                // Skipped: links, which may lead out of the checkout, outputs, and installed packages.
                let is_link = path.is_symlink() || name.starts_with('.');
                if path.is_dir() && !is_link && !["target", "out", "node_modules"].contains(&name.as_str()) {
                    folders.push(path);
                } else if [".md", ".rs", ".toml"].iter().any(|end| name.ends_with(end)) && !is_link {
                    let text =
                        std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
                    texts.insert(self.relative(&path), text);
                }
            }
        }
        Ok(texts)
    }

    /// A path relative to the checkout, with slashes.
    pub fn relative(&self, path: &Path) -> String {
        path.strip_prefix(&self.root).unwrap_or(path).to_string_lossy().replace('\\', "/")
    }
}

impl Package {
    /// Whether it has a target of this kind and name.
    pub fn has(&self, kind: &str, name: &str) -> bool {
        self.targets.iter().any(|target| target.name == name && target.kind.iter().any(|has| has == kind))
    }
}

/// Runs cargo in a folder and returns what it prints.
pub fn cargo(folder: &Path, args: &[&str]) -> anyhow::Result<String> {
    let program = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(program).current_dir(folder).args(args).output().context("cannot run cargo")?;
    let error = String::from_utf8_lossy(&output.stderr);
    let hint = if error.contains("--offline was specified") { "run `cargo fetch` first\n" } else { "" };
    ensure!(output.status.success(), "{hint}cargo {}: {error}", args.join(" "));
    String::from_utf8(output.stdout).context("cargo's output is not UTF-8")
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
    /// The registries to which it may be published; all if absent.
    publish: Option<Vec<String>>,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    kind: Option<String>,
    rename: Option<String>,
    path: Option<PathBuf>,
    req: String,
}

fn packages(metadata: &str, root: &Path) -> anyhow::Result<Vec<Package>> {
    let metadata: Metadata = serde_json::from_str(metadata)?;
    metadata.packages.into_iter().map(|raw| package(raw, root)).collect()
}

fn package(raw: Raw, root: &Path) -> anyhow::Result<Package> {
    let folder = raw.manifest_path.parent().and_then(|folder| folder.strip_prefix(root).ok());
    let folder = folder.with_context(|| format!("{} is outside of the checkout", raw.name))?;
    let folder = folder.to_string_lossy().replace('\\', "/");
    // Tests may depend on their own crate with a feature.
    let dependencies = raw.dependencies.iter().filter(|dependency| dependency.name != raw.name);
    // Dependencies with a path are members of the workspace.
    let (members, others): (Vec<_>, Vec<_>) = dependencies.partition(|dependency| dependency.path.is_some());
    let of_kind = |is_dev: bool| {
        let chosen = members.iter().filter(move |member| (member.kind.as_deref() == Some("dev")) == is_dev);
        chosen.map(|member| member.name.clone())
    };
    let dependencies: BTreeSet<_> = of_kind(false).collect();
    let dev_dependencies = of_kind(true).filter(|name| !dependencies.contains(name)).collect();
    let renamed = members.iter().filter_map(|member| member.rename.clone()).collect();
    let wildcards = others.iter().filter(|other| other.req == "*").map(|other| other.name.clone()).collect();
    let is_published = raw.publish.is_none_or(|registries| !registries.is_empty());
    Ok(Package {
        name: raw.name,
        folder,
        targets: raw.targets,
        dependencies,
        dev_dependencies,
        renamed,
        wildcards,
        is_published,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn metadata_tells_members_from_other_dependencies() {
        let metadata = r#"{"packages": [{"name": "a", "manifest_path": "/root/crates/a/Cargo.toml",
            "targets": [{"name": "a", "kind": ["lib"], "src_path": "/root/crates/a/src/lib.rs", "doctest": true}],
            "dependencies": [
                {"name": "b", "kind": null, "rename": "beta", "path": "/root/crates/b", "req": "*"},
                {"name": "b", "kind": "dev", "rename": null, "path": "/root/crates/b", "req": "*"},
                {"name": "c", "kind": "dev", "rename": null, "path": "/root/crates/c", "req": "*"},
                {"name": "serde", "kind": null, "rename": null, "req": "^1.0"},
                {"name": "toml", "kind": "build", "rename": null, "req": "*"}
            ], "publish": []}]}"#;
        let package = packages(metadata, Path::new("/root")).unwrap().remove(0);
        let names = |set: &BTreeSet<String>| set.iter().cloned().collect::<Vec<_>>().join(" ");
        assert_eq!(
            (package.folder.as_str(), package.has("lib", "a"), package.has("bin", "a")),
            ("crates/a", true, false)
        );
        assert_eq!((names(&package.dependencies), names(&package.dev_dependencies)), ("b".into(), "c".into()));
        assert_eq!((names(&package.renamed), names(&package.wildcards)), ("beta".into(), "toml".into()));
        assert!(!package.is_published);
        assert!(packages(&metadata.replace("[]", "null"), Path::new("/root")).unwrap().remove(0).is_published);
        assert!(packages(metadata, Path::new("/elsewhere")).is_err());
    }
}
