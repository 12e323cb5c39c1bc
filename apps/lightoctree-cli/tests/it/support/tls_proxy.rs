//! nginx as a TLS proxy before the viewer, configured as in `docs/viewer.md`.

use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::support::programs::program;

/// A running nginx; it is killed on drop.
pub struct TlsProxy {
    child: Child,
    /// Origin of the public side, `https://localhost:PORT`.
    pub origin: String,
    /// Port of the viewer behind it.
    pub viewer_port: u16,
    _folder: TempDir,
}

impl TlsProxy {
    /// Starts nginx with a certificate of its own. `None` if nginx or openssl is missing, which skips `untested`; see
    /// [`program`].
    pub fn start(untested: &str) -> Option<Self> {
        let (nginx, openssl) = (program(&["nginx"], untested)?, program(&["openssl"], untested)?);
        let folder = tempfile::tempdir().unwrap();
        let certificate = Command::new(openssl)
            .current_dir(folder.path())
            .args(["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", "key.pem", "-out", "cert.pem"])
            .args(["-days", "1", "-subj", "/CN=localhost"])
            .stderr(Stdio::null())
            .status();
        assert!(certificate.unwrap().success());
        let [port, viewer_port] = [free_port(), free_port()];
        let config = format!(
            "daemon off; master_process off; pid nginx.pid; error_log error.log; events {{}}
             http {{
                 access_log off;
                 client_body_temp_path body; proxy_temp_path proxy; fastcgi_temp_path fastcgi;
                 uwsgi_temp_path uwsgi; scgi_temp_path scgi;
                 server {{
                     listen 127.0.0.1:{port} ssl;
                     ssl_certificate cert.pem; ssl_certificate_key key.pem;
                     location / {{
                         proxy_pass http://127.0.0.1:{viewer_port};
                         proxy_http_version 1.1;
                         proxy_set_header Upgrade $http_upgrade;
                         proxy_set_header Connection \"upgrade\";
                         client_max_body_size 256m;
                     }}
                 }}
             }}"
        );
        std::fs::write(folder.path().join("nginx.conf"), config).unwrap();
        let child = Command::new(nginx)
            .arg("-p")
            .arg(folder.path())
            .args(["-c", "nginx.conf", "-e", "error.log"])
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begun = Instant::now();
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(begun.elapsed() < Duration::from_secs(30), "nginx does not start");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(Self { child, origin: format!("https://localhost:{port}"), viewer_port, _folder: folder })
    }
}

impl Drop for TlsProxy {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns a port that is free at the moment.
pub fn free_port() -> u16 {
    TcpListener::bind(("127.0.0.1", 0)).unwrap().local_addr().unwrap().port()
}
