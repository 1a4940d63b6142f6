#!/bin/sh
# Simulates ten thousand baseline sails over three spin periods, with uncertain lengths, masses, voltages, spin and wind.
#
#     sh experiments/ensembles/monte_carlo.sh FOLDER [--resume]     twelve minutes on two cores
set -e
folder=$1
shift
esail ensemble baseline -o "$folder" --members 10000 --seed 1 \
    --vary 'tethers.length[*]=normal:10e3:10' \
    --vary 'remote_units.mass[*]=normal:1.5:0.015' \
    --vary 'voltage.value[*]=normal:20e3:200' \
    --vary 'initial.spin_rate=normal:4e-3:4e-5' \
    --vary 'solar_wind.speed=normal:4e5:4e4' \
    --vary 'solar_wind.number_density=normal:7.3e6:1.1e6' \
    --observables coning_angle,lagging_angle,sailing_angle,thrust_O,reaction_moment_O,max_axial_strain,smallest_tether_distance,angular_velocity_B \
    --set output.interval=60 --set integrator.tolerance=1e-8 "$@"
esail plot "$folder/ensemble.h5" -o "$folder/figures"
