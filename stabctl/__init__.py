"""stabctl: controller design and linear analysis for transient stability with energy storage."""
