//! The web page at `/`: the bundle in `web/dist`, which `make page` builds from `web/src`, is embedded in the program.
//! The handler takes GET and HEAD on the port of gRPC-Web; calls use POST and are passed on, and other requests are refused.
//!
//! The content security policy allows scripts, styles, images and connections of the page's own origin only.

use std::sync::Arc;

use tonic::{
    body::Body,
    codegen::http::{HeaderMap, Method, Request, Response, StatusCode, header},
};

use super::http_handler::{HttpHandler, misdirected};

/// Path, media type and content of each file.
const FILES: [(&str, &str, &str); 4] = [
    ("/", "text/html; charset=utf-8", include_str!("../../../web/dist/index.html")),
    ("/page.css", "text/css; charset=utf-8", include_str!("../../../web/dist/page.css")),
    ("/page.js", "text/javascript; charset=utf-8", include_str!("../../../web/dist/page.js")),
    ("/icon.svg", "image/svg+xml", include_str!("../../../web/dist/icon.svg")),
];

/// Headers of every answer. They prevent other pages from embedding this one.
const HEADERS: [(header::HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    // The page changes with the program: browsers must revalidate it each time.
    (header::CACHE_CONTROL, "no-cache"),
];

/// Whether a path is one of the page's files.
pub(crate) fn is_page(path: &str) -> bool {
    FILES.iter().any(|(of_file, ..)| *of_file == path)
}

struct File {
    path: &'static str,
    mime: &'static str,
    etag: String,
    contents: &'static str,
}

/// Answers GET and HEAD of any path, and refuses other requests that are not calls.
#[derive(Clone)]
pub(crate) struct Page {
    files: Arc<[File]>,
}

impl Page {
    pub(crate) fn new() -> Self {
        let file = |(path, mime, contents): (&'static str, &'static str, &'static str)| File {
            path,
            mime,
            etag: format!("\"{:08x}-{:x}\"", crc32fast::hash(contents.as_bytes()), contents.len()),
            contents,
        };
        Self { files: FILES.into_iter().map(file).collect() }
    }

    fn file(&self, method: &Method, path: &str, headers: &HeaderMap) -> Response<Body> {
        let body = |text: &str| if method == Method::HEAD { Body::empty() } else { Body::new(text.to_owned()) };
        let mut response = match self.files.iter().find(|file| file.path == path) {
            None => {
                let mut response = Response::new(body("Not found. The page is at /\n"));
                *response.status_mut() = StatusCode::NOT_FOUND;
                set(&mut response, header::CONTENT_TYPE, "text/plain; charset=utf-8");
                response
            }
            Some(file) if is_known(headers, &file.etag) => {
                let mut response = Response::new(Body::empty());
                *response.status_mut() = StatusCode::NOT_MODIFIED;
                set(&mut response, header::ETAG, &file.etag);
                response
            }
            Some(file) => {
                let mut response = Response::new(body(file.contents));
                set(&mut response, header::CONTENT_TYPE, file.mime);
                set(&mut response, header::ETAG, &file.etag);
                set(&mut response, header::CONTENT_LENGTH, &file.contents.len().to_string());
                response
            }
        };
        for (name, value) in HEADERS {
            set(&mut response, name, value);
        }
        response
    }
}

fn set(response: &mut Response<Body>, name: header::HeaderName, value: &str) {
    // All values are ASCII text from this file, and a test sends each of them.
    if let Ok(value) = header::HeaderValue::from_str(value) {
        response.headers_mut().insert(name, value);
    }
}

/// Whether the client already has the version with this tag.
fn is_known(headers: &HeaderMap, etag: &str) -> bool {
    let tags = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    tags.flat_map(|value| value.split(',')).map(str::trim).any(|tag| tag == "*" || tag.trim_start_matches("W/") == etag)
}

impl HttpHandler for Page {
    fn answer(&self, request: &Request<Body>) -> Option<Response<Body>> {
        let (method, path) = (request.method(), request.uri().path());
        let is_read = method == Method::GET || method == Method::HEAD;
        if is_read { Some(self.file(method, path, request.headers())) } else { misdirected(request) }
    }
}
