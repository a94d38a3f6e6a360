//! Controls Chromium through chromedriver.

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use fantoccini::{
    Client, ClientBuilder, Locator,
    actions::{InputSource, MOUSE_BUTTON_LEFT, MouseActions, PointerAction, TouchActions},
    elements::Element,
};
use hyper_util::client::legacy::connect::HttpConnector;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::daemon::Daemon;

/// Time limit of a wait, so that a test fails instead of hanging. It is far longer than any test takes.
const PATIENCE: Duration = Duration::from_secs(90);
/// Interval between checks of a condition.
const POLL: Duration = Duration::from_millis(50);
/// How often Chromium is started for one test, at most.
const STARTS: usize = 3;
/// Number of pointer moves in a drag.
const STEPS: i32 = 12;

/// Emulated screen.
#[derive(Clone, Copy)]
pub enum Screen {
    Desk,
    Phone,
}

/// A browser that shows the page of a daemon; closed on drop.
pub struct Browser {
    driver: Child,
    /// Address of chromedriver, and path of its session.
    address: String,
    session: String,
    pub client: Client,
}

impl Drop for Browser {
    fn drop(&mut self) {
        // End Chromium first, because its processes would outlive the driver.
        let _ = self.request("DELETE", "", "");
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

/// Runs a test with a browser that shows the page of a new daemon, then checks the browser's log for errors. Returns an error if there is no browser.
pub fn with_page<F: AsyncFnOnce(&Browser, &mut Daemon)>(screen: Screen, test: F) -> Result<(), String> {
    for program in ["chromedriver", "chromium"] {
        let there = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !there.is_ok_and(|status| status.success()) {
            return Err(format!("{program} cannot be run: scripts/ensure-page.sh installs it"));
        }
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    runtime.block_on(async {
        let mut daemon = Daemon::start();
        let browser = Browser::open(screen).await;
        browser.client.goto(&daemon.url()).await.unwrap();
        test(&browser, &mut daemon).await;
        let errors = browser.errors();
        assert!(errors.is_empty(), "the browser's log has errors: {errors:#?}");
    });
    Ok(())
}

impl Browser {
    /// Starts the browser. Chromium and its driver sometimes exit while they start, for reasons unrelated to the page. They are then started again,
    /// at most `STARTS` times in all.
    async fn open(screen: Screen) -> Self {
        let mut exits = Vec::new();
        while exits.len() < STARTS {
            match Self::started(screen).await {
                Ok(browser) => return browser,
                Err(exit) => exits.push(exit),
            }
        }
        panic!("Chromium or chromedriver exited at each of {STARTS} starts: {exits:#?}")
    }

    /// Starts the browser once. The error is that of the driver or of the session.
    ///
    /// The driver needs a port that is free at both loopback addresses. A port that the system chooses for one of them can be in use at the other.
    async fn started(screen: Screen) -> Result<Self, String> {
        let port = testkit::free_port();
        let mut driver =
            Command::new("chromedriver").arg(format!("--port={port}")).stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(driver.stdout.take().unwrap()).lines().map(Result::unwrap);
        if !lines.any(|line| line.starts_with("ChromeDriver was started successfully")) {
            let _ = driver.kill();
            return Err(format!("chromedriver on port {port}: {}", driver.wait().unwrap()));
        }
        let address = format!("127.0.0.1:{port}");
        // Shared memory of containers is often too small for Chromium, so it uses files instead.
        let mut options = json!({
            "args": ["--headless=new", "--disable-gpu", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1280,900"],
        });
        if let Screen::Phone = screen {
            let metrics = json!({ "width": 390, "height": 844, "pixelRatio": 2, "touch": true });
            options["mobileEmulation"] = json!({ "deviceMetrics": metrics });
        }
        let capabilities = json!({ "goog:chromeOptions": options, "goog:loggingPrefs": { "browser": "ALL" } });
        let mut builder = ClientBuilder::new(HttpConnector::new());
        builder.capabilities(serde_json::from_value(capabilities).unwrap());
        let client = match builder.connect(&format!("http://{address}")).await {
            Ok(client) => client,
            Err(error) => {
                let _ = driver.kill();
                let _ = driver.wait();
                return Err(error.to_string());
            }
        };
        let session = client.session_id().await.unwrap().expect("a session has a number");
        Ok(Self { driver, address, session: format!("/session/{session}"), client })
    }

    /// Sends a command to chromedriver that is not part of the WebDriver standard.
    fn request(&self, method: &str, path: &str, body: &str) -> std::io::Result<String> {
        let mut socket = TcpStream::connect(&self.address)?;
        let (session, length) = (&self.session, body.len());
        write!(
            socket,
            "{method} {session}{path} HTTP/1.1\r\nhost: {}\r\ncontent-type: application/json\r\ncontent-length: {length}\r\n\
             connection: close\r\n\r\n{body}",
            self.address
        )?;
        // The driver keeps the connection open: read up to the content length.
        socket.set_read_timeout(Some(PATIENCE))?;
        let mut answer = BufReader::new(socket);
        let (mut line, mut length) = (String::new(), 0);
        while answer.read_line(&mut line)? > 2 {
            if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
                length = value.trim().parse().map_err(std::io::Error::other)?;
            }
            line.clear();
        }
        let mut body = vec![0; length];
        answer.read_exact(&mut body)?;
        String::from_utf8(body).map_err(std::io::Error::other)
    }

    /// Returns the errors in the browser's log since the last call.
    pub fn errors(&self) -> Vec<String> {
        let answer = self.request("POST", "/se/log", r#"{"type": "browser"}"#).unwrap();
        let answer: Value = serde_json::from_str(&answer).unwrap_or_else(|error| panic!("{error}: {answer}"));
        let entries = answer["value"].as_array().unwrap_or_else(|| panic!("{answer}"));
        let errors = entries.iter().filter(|entry| entry["level"] == "SEVERE");
        errors.map(|entry| entry["message"].to_string()).collect()
    }

    /// Like [`Self::errors`], without failed connections.
    pub fn errors_beside_connections(&self) -> Vec<String> {
        self.errors().into_iter().filter(|error| !error.contains("net::ERR_")).collect()
    }

    /// Also leaves out the status 503, with which a restarted daemon answers while it starts. Chromium may request the icon at that time.
    pub fn errors_beside_restarts(&self) -> Vec<String> {
        self.errors_beside_connections().into_iter().filter(|error| !error.contains("a status of 503")).collect()
    }

    /// Returns the result of a script.
    pub async fn run<T: DeserializeOwned>(&self, script: &str) -> T {
        let value = self.client.execute(script, Vec::new()).await.unwrap_or_else(|error| panic!("{script}: {error}"));
        serde_json::from_value(value.clone()).unwrap_or_else(|error| panic!("{script} gives {value}: {error}"))
    }

    /// Waits until an expression is true.
    pub async fn until(&self, expression: &str) {
        let deadline = Instant::now() + PATIENCE;
        while !self.run::<bool>(&format!("return Boolean({expression})")).await {
            assert!(Instant::now() < deadline, "never true: {expression}\n{}", self.page().await);
            tokio::time::sleep(POLL).await;
        }
    }

    /// Returns the text of the page, for messages.
    async fn page(&self) -> String {
        self.run("return document.body.innerText").await
    }

    /// Returns the first element that matches a selector. Waits for it, because the page may still be filling its list.
    pub async fn find(&self, selector: &str) -> Element {
        let deadline = Instant::now() + PATIENCE;
        loop {
            match self.client.find(Locator::Css(selector)).await {
                Ok(element) => return element,
                Err(error) => assert!(Instant::now() < deadline, "{selector}: {error}"),
            }
            tokio::time::sleep(POLL).await;
        }
    }

    pub async fn click(&self, selector: &str) {
        self.find(selector).await.click().await.unwrap_or_else(|error| panic!("{selector}: {error}"));
    }

    /// Replaces the value of an input.
    pub async fn fill(&self, selector: &str, text: &str) {
        let input = self.find(selector).await;
        input.clear().await.unwrap();
        input.send_keys(text).await.unwrap();
    }

    /// Types into the focused element.
    pub async fn press(&self, keys: &str) {
        self.client.active_element().await.unwrap().send_keys(keys).await.unwrap();
    }

    /// Drags from one point of the window to another, by mouse or finger.
    pub async fn drag(&self, screen: Screen, from: [f64; 2], to: [f64; 2]) {
        let mut moves = vec![PointerAction::MoveTo { duration: None, x: from[0], y: from[1] }];
        moves.push(PointerAction::Down { button: MOUSE_BUTTON_LEFT });
        for step in 1..=STEPS {
            let share = f64::from(step) / f64::from(STEPS);
            let [x, y] = [0, 1].map(|i| from[i] + share * (to[i] - from[i]));
            moves.push(PointerAction::MoveTo { duration: Some(Duration::from_millis(20)), x, y });
        }
        moves.push(PointerAction::Up { button: MOUSE_BUTTON_LEFT });
        let result = match screen {
            Screen::Desk => {
                let mouse = moves.into_iter().fold(MouseActions::new("mouse".to_owned()), InputSource::then);
                self.client.perform_actions(mouse).await
            }
            Screen::Phone => {
                let finger = moves.into_iter().fold(TouchActions::new("finger".to_owned()), InputSource::then);
                self.client.perform_actions(finger).await
            }
        };
        result.unwrap();
    }

    /// Finds the brightest pixel of a canvas, either anywhere or within `radius` of a point. Returns its centre in the window, and the sum of its
    /// codes.
    pub async fn brightest(&self, canvas: &str, near: Option<([f64; 2], f64)>) -> ([f64; 2], u32) {
        let script = format!(
            "const canvas = document.querySelector({canvas:?}), near = {};
             const {{ width, height }} = canvas, box = canvas.getBoundingClientRect();
             const pixels = canvas.getContext('2d').getImageData(0, 0, width, height).data;
             let best = [0, 0, -1];
             for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) {{
               const i = 4 * (y * width + x), sum = pixels[i] + pixels[i + 1] + pixels[i + 2];
               if (sum <= best[2]) continue;
               const at = [box.left + (x + 0.5) / width * box.width, box.top + (y + 0.5) / height * box.height];
               if (near && Math.hypot(at[0] - near[0][0], at[1] - near[0][1]) > near[1]) continue;
               best = [...at, sum];
             }}
             return [[best[0], best[1]], best[2]]",
            json!(near)
        );
        self.run(&script).await
    }
}
