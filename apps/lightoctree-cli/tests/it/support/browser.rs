//! Controls a headless Chromium of the system through its DevTools protocol
//! (<https://chromedevtools.github.io/devtools-protocol/>).

use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use base64::Engine;
use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

use crate::support::programs::program;

/// Names of Chromium and Chrome; the first one found is used.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Maximum duration of an operation.
const PATIENCE: Duration = Duration::from_secs(120);

/// Expression for the state of the viewer's page, for messages of failed tests.
const PAGE_STATE: &str = "(() => { const { page, figures } = globalThis.viewer ?? {}; const text = (id) => document.getElementById(id)?.textContent;
  return { status: text('status'), messages: text('messages'), change: page?.change, shown: figures?.shown, gesture: page?.gesture?.()?.handle,
           selected: page?.selectedId, objects: page?.view?.objects }; })()";

/// A browser with one page; it is killed on drop.
pub struct Browser {
    child: Child,
    socket: WebSocket<TcpStream>,
    session: String,
    calls: u64,
    /// Whether the left mouse button is pressed.
    is_pressed: bool,
    /// Exceptions and errors of the page.
    pub faults: Vec<String>,
    _profile: TempDir,
}

impl Browser {
    /// Starts a browser without WebGL. `None` if no browser is installed, which skips `untested`; see [`program`].
    pub fn start(untested: &str) -> Option<Self> {
        program(&NAMES, untested).map(|path| Self::launch(&path, &["--disable-gpu", "--disable-3d-apis"]))
    }

    /// Starts a browser with WebGL, which SwiftShader computes.
    pub fn start_with_webgl(untested: &str) -> Option<Self> {
        program(&NAMES, untested)
            .map(|path| Self::launch(&path, &["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]))
    }

    fn launch(program: &Path, graphics: &[&str]) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let child = std::process::Command::new(program)
            .args(["--headless=new", "--no-sandbox", "--disable-dev-shm-usage"])
            .args(graphics)
            .args([
                // The TLS proxy of the tests signs its own certificate.
                "--ignore-certificate-errors",
                // A host name that the tests use for this machine.
                "--host-resolver-rules=MAP studio.example 127.0.0.1",
                "--no-first-run",
                "--disable-background-networking",
                "--hide-scrollbars",
                "--remote-debugging-port=0",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begun = Instant::now();
        let active_port = loop {
            let active_port = std::fs::read_to_string(profile.path().join("DevToolsActivePort")).unwrap_or_default();
            if active_port.lines().count() >= 2 {
                break active_port;
            }
            assert!(begun.elapsed() < PATIENCE, "the browser does not start");
            std::thread::sleep(Duration::from_millis(50));
        };
        let (port, path) = active_port.trim().split_once('\n').unwrap();
        let stream = TcpStream::connect(format!("127.0.0.1:{port}")).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(format!("ws://127.0.0.1:{port}{path}"), stream).unwrap();
        let (session, faults) = (String::new(), Vec::new());
        let mut browser = Self { child, socket, session, calls: 0, is_pressed: false, faults, _profile: profile };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone();
        let attached = browser.call("Target.attachToTarget", json!({ "targetId": target, "flatten": true }));
        browser.session = attached["sessionId"].as_str().unwrap().to_owned();
        for domain in ["Runtime", "Page", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser
    }

    /// Calls a method of the protocol.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.calls += 1;
        let mut call = json!({ "id": self.calls, "method": method, "params": params });
        if !self.session.is_empty() {
            call["sessionId"] = json!(self.session);
        }
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else { continue };
            let message: Value = serde_json::from_str(&text).unwrap();
            match message["method"].as_str() {
                Some("Runtime.exceptionThrown") => self.faults.push(message["params"]["exceptionDetails"].to_string()),
                Some("Log.entryAdded") if message["params"]["entry"]["level"] == "error" => {
                    self.faults.push(message["params"]["entry"].to_string());
                }
                _ => {}
            }
            if message["id"] == self.calls {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].clone();
            }
        }
    }

    /// Opens an address in a window of a size.
    pub fn open(&mut self, address: &str, [width, height]: [u32; 2]) {
        self.resize([width, height]);
        self.call("Page.navigate", json!({ "url": address }));
        self.wait("document.readyState === 'complete'");
    }

    /// Resizes the window.
    pub fn resize(&mut self, [width, height]: [u32; 2]) {
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// Evaluates an expression in the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let params = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let result = self.call("Runtime.evaluate", params);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true. While it throws, such as before the page has received the scene's state, it
    /// is not.
    pub fn wait(&mut self, expression: &str) {
        let begun = Instant::now();
        let caught =
            format!("(() => {{ try {{ return Boolean({expression}); }} catch (e) {{ return String(e); }} }})()");
        loop {
            let found = self.value(&caught);
            if found == true {
                return;
            }
            if begun.elapsed() >= PATIENCE {
                let state = self.value(PAGE_STATE);
                panic!("waited for {expression} in vain ({found}); faults: {:?}; the page: {state}", self.faults);
            }
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Sends a mouse event: `mouseMoved`, `mousePressed` or `mouseReleased`, of the left button.
    pub fn mouse(&mut self, kind: &str, [x, y]: [f64; 2]) {
        let was_pressed = self.is_pressed;
        self.is_pressed = match kind {
            "mousePressed" => true,
            "mouseReleased" => false,
            _ => was_pressed,
        };
        // A movement without a button ends the pointer's capture, and with it a drag, in Chromium.
        let button = if was_pressed || self.is_pressed { "left" } else { "none" };
        let buttons = i32::from(self.is_pressed);
        let params = json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Drags with the left button from one position to another; `modifiers`: 8 for Shift.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2], modifiers: u32) {
        const STEPS: u32 = 6;
        let at = |step: u32| [0, 1].map(|i| from[i] + f64::from(step) / f64::from(STEPS) * (to[i] - from[i]));
        let moves = (0..=STEPS).map(|step| ("mouseMoved", at(step), i32::from(step > 0)));
        let mut events: Vec<(&str, [f64; 2], i32)> = moves.collect();
        events.insert(1, ("mousePressed", from, 1));
        events.push(("mouseReleased", to, 0));
        for (kind, [x, y], buttons) in events {
            let button = if kind == "mouseMoved" && buttons == 0 { "none" } else { "left" };
            self.call(
                "Input.dispatchMouseEvent",
                json!({
                    "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1, "modifiers": modifiers,
                }),
            );
        }
    }

    /// Presses and releases a key; `modifiers`: 2 for Ctrl, 8 for Shift.
    pub fn key(&mut self, key: &str, modifiers: u32) {
        for kind in ["rawKeyDown", "keyUp"] {
            self.call("Input.dispatchKeyEvent", json!({ "type": kind, "key": key, "modifiers": modifiers }));
        }
    }

    /// Drops a file onto the page.
    pub fn drop_file(&mut self, name: &str, bytes: &[u8]) {
        let base64 = base64::engine::general_purpose::STANDARD.encode(bytes);
        self.value(&format!(
            "(() => {{ const bytes = Uint8Array.from(atob('{base64}'), (c) => c.charCodeAt(0));
               const files = new DataTransfer(); files.items.add(new File([bytes], '{name}'));
               document.dispatchEvent(new DragEvent('drop', {{ dataTransfer: files, cancelable: true }})); }})()"
        ));
    }

    /// Writes a screenshot of the page.
    pub fn screenshot(&mut self, path: &Path) {
        let shot = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        let bytes = base64::engine::general_purpose::STANDARD.decode(shot["data"].as_str().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
