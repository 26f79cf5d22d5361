"""Pictures, videos and plots."""
