//! The page's files, built into the program.

use std::sync::Arc;

use axum::Router;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::shared::Shared;

const JAVASCRIPT: &str = "text/javascript; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";

/// Path, type and content of each file.
const FILES: [(&str, &str, &str); 15] = [
    ("/icon.svg", "image/svg+xml", include_str!("page/icon.svg")),
    ("/page.css", CSS, include_str!("page/page.css")),
    ("/page.js", JAVASCRIPT, include_str!("page/page.js")),
    ("/structure.js", JAVASCRIPT, include_str!("page/structure.js")),
    ("/drawing.js", JAVASCRIPT, include_str!("page/drawing.js")),
    ("/plots.js", JAVASCRIPT, include_str!("page/plots.js")),
    ("/clipped.js", JAVASCRIPT, include_str!("page/clipped.js")),
    ("/canvas.js", JAVASCRIPT, include_str!("page/canvas.js")),
    ("/events.js", JAVASCRIPT, include_str!("page/events.js")),
    ("/history.js", JAVASCRIPT, include_str!("page/history.js")),
    ("/save.js", JAVASCRIPT, include_str!("page/save.js")),
    ("/stream.js", JAVASCRIPT, include_str!("page/stream.js")),
    ("/controls.js", JAVASCRIPT, include_str!("page/controls.js")),
    ("/uplot/uPlot.js", JAVASCRIPT, include_str!("page/uplot/uPlot.iife.min.js")),
    ("/uplot/uPlot.css", CSS, include_str!("page/uplot/uPlot.min.css")),
];

/// Returns the HTML of the page.
pub fn index() -> Response {
    ([(CONTENT_TYPE, "text/html; charset=utf-8")], include_str!("page/index.html")).into_response()
}

/// The page's other files.
pub fn files() -> Router<Arc<Shared>> {
    FILES.into_iter().fold(Router::new(), |router, (path, kind, content)| {
        router.route(path, get(move || async move { ([(CONTENT_TYPE, kind)], content) }))
    })
}
