//! A running `lightoctree view`, and a page that is connected to it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::Value;
use tungstenite::protocol::Role;
use tungstenite::{Message, WebSocket};

/// Maximum duration of an operation.
const PATIENCE: Duration = Duration::from_secs(300);

/// A running `view`, killed on drop.
pub struct Viewer {
    child: Child,
    /// `http://127.0.0.1:PORT/TOKEN/`
    pub address: String,
}

impl Viewer {
    /// Starts the viewer in a folder and waits for its address.
    pub fn start(folder: &Path, args: &[&str]) -> Self {
        let viewer = Self::start_with(folder, args, |command| command);
        let address = &viewer.address;
        assert!(address.starts_with("http://127.0.0.1:") || address.starts_with("https://localhost:"), "{address}");
        viewer
    }

    /// Starts the viewer as [`Viewer::start`] does, with changes of its command. Without `--recent` it saves no rooms.
    pub fn start_with(folder: &Path, args: &[&str], change: impl Fn(&mut Command) -> &mut Command) -> Self {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("lightoctree"));
        command.current_dir(folder).args(["--quiet", "view"]).args(args).stdout(Stdio::piped());
        if !args.contains(&"--recent") {
            command.arg("--no-recent");
        }
        let mut child = change(&mut command).spawn().unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { child, address: address.trim().to_owned() }
    }

    /// Returns host and port, and `/TOKEN/`.
    pub fn host_and_path(&self) -> (&str, &str) {
        let rest = self.address.strip_prefix("http://").unwrap();
        rest.split_at(rest.find('/').unwrap())
    }

    /// Sends a request with header lines and a body. Returns status and body of the response.
    pub fn request(&self, method: &str, path: &str, lines: &[&str], body: &[u8]) -> (u16, Vec<u8>) {
        let (host, _) = self.host_and_path();
        let mut stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(stream, "{method} {path} HTTP/1.1\r\nConnection: close\r\n{}\r\n\r\n", lines.join("\r\n")).unwrap();
        stream.write_all(body).unwrap();
        let mut answer = Vec::new();
        // An early refusal closes the connection.
        let _ = stream.read_to_end(&mut answer);
        let end =
            answer.windows(4).position(|window| window == b"\r\n\r\n").unwrap_or(answer.len().saturating_sub(4)) + 4;
        let head = String::from_utf8_lossy(&answer[..end]).into_owned();
        let status = head.split(' ').nth(1).unwrap_or("0").parse().unwrap();
        let body = &answer[end..];
        let is_chunked = head.to_lowercase().contains("transfer-encoding: chunked");
        (status, if is_chunked { unchunked(body) } else { body.to_vec() })
    }

    /// Fetches a path below the token.
    pub fn get(&self, path: &str) -> (u16, Vec<u8>) {
        let (host, token) = self.host_and_path();
        self.request("GET", &format!("{token}{path}"), &[&format!("Host: {host}")], b"")
    }

    /// Uploads a file.
    pub fn upload(&self, kind: &str, name: &str, bytes: &[u8]) -> (u16, String) {
        let (host, token) = self.host_and_path();
        let lines =
            [format!("Host: {host}"), format!("X-File-Name: {name}"), format!("Content-Length: {}", bytes.len())];
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        let (status, text) = self.request("POST", &format!("{token}upload/{kind}"), &lines, bytes);
        (status, String::from_utf8(text).unwrap())
    }

    /// Connects as a page does.
    pub fn page(&self) -> Page {
        let (host, path) = self.host_and_path();
        Page::connect(host, path)
    }

    /// Presses Ctrl-C once and waits for the end.
    #[cfg(unix)]
    pub fn interrupt(&mut self) -> ExitStatus {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        let begun = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(begun.elapsed() < PATIENCE, "the viewer does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Returns the command line that other users of the machine can see.
    #[cfg(target_os = "linux")]
    pub fn command_line(&self) -> String {
        let bytes = std::fs::read(format!("/proc/{}/cmdline", self.child.id())).unwrap();
        String::from_utf8_lossy(&bytes).replace('\0', " ")
    }

    /// Returns what the program printed on stderr, if that is a pipe, up to a line that contains `last`.
    pub fn warnings(&mut self, last: &str) -> String {
        let mut stderr = BufReader::new(self.child.stderr.take().unwrap());
        let mut text = String::new();
        while !text.contains(last) && stderr.read_line(&mut text).unwrap() > 0 {}
        text
    }

    /// Returns whether the program is running.
    pub fn is_alive(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Returns the resident memory, MB.
    pub fn memory_mb(&self) -> f64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A page's end of the WebSocket. A thread receives all messages and answers pings, as browsers do.
pub struct Page {
    socket: WebSocket<TcpStream>,
    received: Receiver<Message>,
}

impl Page {
    /// Connects to the socket below `path` of a host.
    pub fn connect(host: &str, path: &str) -> Self {
        let stream = TcpStream::connect(host).unwrap();
        let (mut reader, _) = tungstenite::client(format!("ws://{host}{path}socket"), stream).unwrap();
        let socket = WebSocket::from_raw_socket(reader.get_ref().try_clone().unwrap(), Role::Client, None);
        let (sender, received) = channel();
        std::thread::spawn(move || {
            while let Ok(message) = reader.read() {
                // Reading a ping answers it.
                if !message.is_ping() && sender.send(message).is_err() {
                    break;
                }
            }
        });
        Self { socket, received }
    }

    /// Sends a message.
    pub fn send(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// Executes a command as one step of the history.
    pub fn act(&mut self, command: &Value) {
        self.send(&serde_json::json!({ "type": "command", "command": command }));
    }

    /// Waits for the next message that `is_wanted` accepts. Returns it with its images.
    pub fn receive(&mut self, what: &str, is_wanted: impl Fn(&Value) -> bool) -> (Value, Vec<u8>) {
        let begun = Instant::now();
        while let Some(left) = PATIENCE.checked_sub(begun.elapsed()) {
            let Ok(message) = self.received.recv_timeout(left) else { break };
            if let Some((message, images)) = decoded(message).filter(|(message, _)| is_wanted(message)) {
                return (message, images);
            }
        }
        panic!("waited for {what} in vain");
    }

    /// Returns the messages that arrive until there is none for some time.
    pub fn until_quiet(&mut self, pause: Duration) -> Vec<Value> {
        std::iter::from_fn(|| self.received.recv_timeout(pause).ok())
            .filter_map(decoded)
            .map(|(json, _)| json)
            .collect()
    }

    /// Returns code and reason with which the program closes the connection; `None` if another message comes first.
    pub fn closing(&mut self) -> Option<(u16, String)> {
        match self.received.recv_timeout(PATIENCE) {
            Ok(Message::Close(Some(frame))) => Some((frame.code.into(), frame.reason.to_string())),
            _ => None,
        }
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        // Ends the thread.
        let _ = self.socket.get_ref().shutdown(Shutdown::Both);
    }
}

/// Returns the JSON and the images of a message of the program.
fn decoded(message: Message) -> Option<(Value, Vec<u8>)> {
    match message {
        Message::Text(text) => Some((serde_json::from_str(&text).unwrap(), Vec::new())),
        Message::Binary(bytes) => {
            let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
            Some((serde_json::from_slice(&bytes[4..4 + length]).unwrap(), bytes[4 + length..].to_vec()))
        }
        _ => None,
    }
}

/// Decodes a chunked body (RFC 9112, 7.1), as far as it was received.
fn unchunked(mut body: &[u8]) -> Vec<u8> {
    let mut whole = Vec::new();
    while let Some(end) = body.windows(2).position(|window| window == b"\r\n") {
        let length = usize::from_str_radix(std::str::from_utf8(&body[..end]).unwrap(), 16).unwrap();
        let piece = &body[end + 2..];
        if length == 0 || piece.len() < length + 2 {
            break;
        }
        whole.extend(&piece[..length]);
        body = &piece[length + 2..];
    }
    whole
}
