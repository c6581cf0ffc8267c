"""Designs to look at: pictures (extra ``report``) and the rerun viewer's recording (extra ``view``)."""
