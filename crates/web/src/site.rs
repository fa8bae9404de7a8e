//! What is served at an address: tables of routes behind a guard.

use crate::Problem;
use crate::guard::{Guard, guard};
use axum::Router;
use axum::http::{Method, StatusCode};
use axum::middleware::from_fn_with_state;
use axum::routing::{MethodFilter, MethodRouter};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

/// A row of a table of routes.
pub struct Route<S> {
    /// What is done.
    pub method: Method,
    /// To what, as axum writes it: `/v1/drives/{drive}`.
    pub path: &'static str,
    /// Lets the handler answer the method.
    pub handler: fn(MethodFilter) -> MethodRouter<S>,
}

impl<S> fmt::Debug for Route<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.method, self.path)
    }
}

/// A row, as in `route(Method::GET, "/v1/rig", |method| on(method, rig))`.
pub const fn route<S>(
    method: Method,
    path: &'static str,
    handler: fn(MethodFilter) -> MethodRouter<S>,
) -> Route<S> {
    Route { method, path, handler }
}

/// Routes as a table has them. A method that axum does not know is left out.
pub fn router<S: Clone + Send + Sync + 'static>(table: impl IntoIterator<Item = Route<S>>) -> Router<S> {
    let routes = table.into_iter().filter_map(|route| {
        let method = MethodFilter::try_from(route.method).ok()?;
        Some((route.path, (route.handler)(method)))
    });
    routes.fold(Router::new(), |router, (path, method)| router.route(path, method))
}

/// Method and path of everything that an `OpenAPI` document describes, for the test that holds it to its table of routes;
/// empty when it is none.
pub fn described(document: &str) -> BTreeSet<(String, String)> {
    let document: Value = serde_json::from_str(document).unwrap_or_default();
    let paths = document["paths"].as_object().into_iter().flatten();
    let operations = paths.flat_map(|(path, item)| {
        let methods = item.as_object().into_iter().flatten().map(|(key, _)| key);
        let methods = methods.filter(|key| *key != "parameters");
        methods.map(|method| (method.to_ascii_uppercase(), path.clone()))
    });
    operations.collect()
}

/// All that is served at an address, and who may ask for it.
pub struct Site {
    routes: Router,
    guard: Guard,
    documents: &'static str,
}

impl fmt::Debug for Site {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Site").finish_non_exhaustive()
    }
}

impl Site {
    /// Routes without fallbacks, behind a guard. Whoever asks for something else is told that `documents` says what there
    /// is, as in `GET /openapi.json`.
    pub fn new(routes: Router, guard: Guard, documents: &'static str) -> Site {
        Site { routes, guard, documents }
    }

    /// Serves these, too. They have no path of the others.
    #[must_use]
    pub fn with(self, more: Router) -> Site {
        Site { routes: self.routes.merge(more), ..self }
    }

    pub(crate) fn into_router(self) -> Router {
        let Site { routes, guard: by, documents } = self;
        let nothing_here = move || async move {
            let message = format!("there is nothing here; {documents} says what there is");
            Problem::new(StatusCode::NOT_FOUND, message)
        };
        let wrong_method = move || async move {
            let message =
                format!("this cannot be done here; the Allow header says what can, and {documents} how");
            Problem::new(StatusCode::METHOD_NOT_ALLOWED, message)
        };
        routes
            .fallback(nothing_here)
            .method_not_allowed_fallback(wrong_method)
            .layer(from_fn_with_state(Arc::new(by), guard))
    }
}
