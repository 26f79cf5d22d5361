"""Control laws: tasks, evasive velocity and activations in, joint velocity out. They are interchangeable."""
