/* Runs the observer: reads start and its sd, then per step current, losses, sink, reading. */
#include <stdio.h>

#include "thermal_network.h"

int main(void)
{
    heatrun_observer observer;
    heatrun_real start[HEATRUN_NUM_NODES];
    double first, sd, row[4];
    int i;
    if (scanf("%lf %lf", &first, &sd) != 2) {
        return 2;
    }
    for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
        start[i] = (heatrun_real)first;
    }
    if (heatrun_observer_start(&observer, start, (heatrun_real)sd) != HEATRUN_OK) {
        return 3;
    }
    while (scanf("%lf %lf %lf %lf", &row[0], &row[1], &row[2], &row[3]) == 4) {
        heatrun_inputs inputs;
        heatrun_estimate now;
        inputs.current_A = (heatrun_real)row[0];
        inputs.losses_W = (heatrun_real)row[1];
        inputs.sink_degC = (heatrun_real)row[2];
        now = heatrun_observer_step(&observer, &inputs, (heatrun_real)row[3]);
        for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
            printf("%.9g %.9g ", (double)now.temperature_degC[i], (double)now.sd_K[i]);
        }
        printf("%d %d\n", (int)now.status, (int)now.sensor);
    }
    return sizeof(heatrun_observer) < 1024 ? 0 : 4;
}
