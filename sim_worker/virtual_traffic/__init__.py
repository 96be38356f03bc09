"""One going simulation of road users around the real car, who exist nowhere else."""
