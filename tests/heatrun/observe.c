/* Runs the observer: `observe START SD` reads, for each step, doubles of inputs and reading, and
 * writes temperature and standard deviation of each node, status and sensor. With -DBY_RESISTANCE
 * the reading is a resistance. */
#include <stdio.h>
#include <stdlib.h>

#include "thermal_network.h"

#define NUM_INPUTS (3 + HEATRUN_HAS_SECOND_SINK + HEATRUN_HAS_COOLANT + HEATRUN_HAS_SPEED \
                    + HEATRUN_HAS_FAN)

int main(int num_words, char **words)
{
    heatrun_observer observer;
    heatrun_real start[HEATRUN_NUM_NODES];
    double row[NUM_INPUTS + 1], found[2*HEATRUN_NUM_NODES + 2];
    int i;
    if (num_words != 3) {
        return 2;
    }
    for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
        start[i] = (heatrun_real)atof(words[1]);
    }
    if (heatrun_observer_start(&observer, start, (heatrun_real)atof(words[2])) != HEATRUN_OK) {
        return 3;
    }
    while (fread(row, sizeof row, 1, stdin) == 1) {
        const double *next = row;
        heatrun_inputs inputs;
        heatrun_estimate now;
        inputs.current_A = (heatrun_real)*next++;
        inputs.losses_W = (heatrun_real)*next++;
        inputs.sink_degC = (heatrun_real)*next++;
#if HEATRUN_HAS_SECOND_SINK
        inputs.second_sink_degC = (heatrun_real)*next++;
#endif
#if HEATRUN_HAS_COOLANT
        inputs.coolant_degC = (heatrun_real)*next++;
#endif
#if HEATRUN_HAS_SPEED
        inputs.speed_rpm = (heatrun_real)*next++;
#endif
#if HEATRUN_HAS_FAN
        inputs.fan = (heatrun_real)*next++;
#endif
#ifdef BY_RESISTANCE
        row[NUM_INPUTS] = (double)heatrun_winding_degC(&heatrun_cold_winding, (heatrun_real)*next);
#endif
        now = heatrun_observer_step(&observer, &inputs, (heatrun_real)*next);
        for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
            found[2*i] = (double)now.temperature_degC[i];
            found[2*i + 1] = (double)now.sd_K[i];
        }
        found[2*HEATRUN_NUM_NODES] = (double)now.status;
        found[2*HEATRUN_NUM_NODES + 1] = (double)now.sensor;
        if (fwrite(found, sizeof found, 1, stdout) != 1) {
            return 5;
        }
    }
    return sizeof(heatrun_observer) < 1024 ? 0 : 4;
}
