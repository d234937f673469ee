"""Pictures and plots; the recording for the rerun viewer is in rerun/."""
