//! Weighted averages on surfaces (Panozzo et al. 2013).
