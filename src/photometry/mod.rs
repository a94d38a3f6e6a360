//! Photometry: from magnitude and temperature to light.
