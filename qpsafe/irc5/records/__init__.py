"""Records of joint references."""
