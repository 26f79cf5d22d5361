"""qpsafe inside other people's loops: tasks and limits for mink and pink, and tasks converted both ways."""
