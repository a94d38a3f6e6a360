//! Users of SGCT: position of the eye of a viewport.

use glam::DVec3;

use super::{
    Reader,
    fault::{Fault, shown},
    json::Field,
};

/// Default distance between the eyes of a user of SGCT, m.
const EYE_SEPARATION_M: f64 = 0.06;

impl Reader<'_> {
    /// Returns the position of the eye for which a viewport is drawn. It is the position of the user, or half the eye separation to the side of it.
    pub(super) fn eye(&mut self, viewport: &Field, users: &[Field]) -> Result<DVec3, Fault> {
        let side = match viewport.get("eye")? {
            None => 0.0,
            Some(eye) => match eye.text()?.to_ascii_lowercase().as_str() {
                "center" => 0.0,
                "left" => -0.5,
                "right" => 0.5,
                other => {
                    let problem = format!("`{}`", other.escape_debug());
                    return Err(Fault::new(&eye.place, problem, "must be one of center, left and right"));
                }
            },
        };
        let user = user_of(viewport, users)?;
        let middle = self.middle_of_eyes(user.as_ref())?;
        if side == 0.0 {
            return Ok(middle);
        }
        // SGCT separates the eyes along the x axis of the room, even if the user is turned.
        let separation = user.map(|user| user.optional_number("eyeseparation")).transpose()?.flatten();
        let separation_m = separation.unwrap_or(EYE_SEPARATION_M);
        let eye = middle + DVec3::X * (side * separation_m);
        self.note(format!(
            "{}: for one eye, at {} m; the scene is drawn from the midpoint between the eyes, which matters only for objects within some metres",
            viewport.place,
            shown(eye.to_array())
        ));
        Ok(eye)
    }

    /// Returns the midpoint between the eyes: the position of the viewport's user, or the position in the options.
    fn middle_of_eyes(&mut self, user: Option<&Field>) -> Result<DVec3, Fault> {
        if let Some(tracking) = user.map(|user| user.get("tracking")).transpose()?.flatten() {
            self.note(format!("{}: it has no effect; the eye has the position that the file gives", tracking.place));
        }
        let requested = self.options.eye_m;
        match user.map(|user| self.own_place(user)).transpose()?.flatten() {
            Some((position, place)) if requested != DVec3::ZERO && !requested.abs_diff_eq(position, 1e-9) => {
                let [own, asked] = [position, requested].map(|at| shown(at.to_array()));
                let problem = format!("the eye is at {own} in the file, but at {asked} in the options");
                Err(Fault::new(place, problem, "omit one, or make them equal"))
            }
            Some((position, place)) => {
                self.note(format!("eye: from {place} in the file, at {} m", shown(position.to_array())));
                Ok(position)
            }
            None => {
                self.note(format!("eye: at {} m; the file does not specify its position", shown(requested.to_array())));
                Ok(requested)
            }
        }
    }

    /// Returns the position of a user, and the key that gives it. SGCT multiplies `pos` by `matrix`, or by `orientation` if there is one.
    fn own_place(&mut self, user: &Field) -> Result<Option<(DVec3, String)>, Fault> {
        let [pos, matrix, orientation] = [user.get("pos")?, user.get("matrix")?, user.get("orientation")?];
        let position = pos.as_ref().map_or(Ok(DVec3::ZERO), Field::vector)?;
        Ok(match (pos, matrix, orientation) {
            (None, None, None) => None,
            (Some(pos), None, None) => Some((position, pos.place)),
            (_, Some(matrix), None) => {
                let moved = matrix.matrix()? * position.extend(1.0);
                Some((moved.truncate(), matrix.place))
            }
            (_, matrix, Some(orientation)) => {
                if let Some(matrix) = matrix {
                    self.note(format!("{}: it has no effect: as in SGCT, the orientation replaces it", matrix.place));
                }
                Some((orientation.rotation()? * position, orientation.place))
            }
        })
    }
}

/// Returns the user of a viewport: the user that it names, or the first one.
fn user_of<'a>(viewport: &Field, users: &[Field<'a>]) -> Result<Option<Field<'a>>, Fault> {
    let Some(wanted) = viewport.get("user")? else { return Ok(users.first().cloned()) };
    let name = wanted.text()?;
    let mut found = None;
    for user in users {
        if let Some(own) = user.get("name")?
            && own.text()? == name
        {
            found = Some(user.clone());
        }
    }
    found.map(Some).ok_or_else(|| {
        let problem = format!("no user `{}`", name.escape_debug());
        Fault::new(&wanted.place, problem, "must be one of `users`")
    })
}
