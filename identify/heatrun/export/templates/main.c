/* heatrun export: replays vectors.csv and prints the largest difference to lptn
 *
 *   cc -std=c99 -O2 -o replay main.c thermal_network.c
 *   ./replay vectors.csv
 *
 * Exit status 0 where it is below 1e-6 K (double) or 0.05 K (float), else 1.
 */
#include <stdio.h>
#include <stdlib.h>

#include "thermal_network.h"

#define NUM_INPUTS (3 + HEATRUN_HAS_SECOND_SINK + HEATRUN_HAS_COOLANT + HEATRUN_HAS_SPEED \
                    + HEATRUN_HAS_FAN)
#define NUM_COLUMNS (1 + NUM_INPUTS + HEATRUN_NUM_NODES)

/* Return whether a line holds a number for every column. */
static int read_row(const char *line, double row[NUM_COLUMNS])
{
    int i;
    for (i = 0; i < NUM_COLUMNS; ++i) {
        char *end;
        row[i] = strtod(line, &end);
        if (end == line) {
            return 0;
        }
        line = *end == ',' ? end + 1 : end;
    }
    return 1;
}

int main(int num_words, char **words)
{
    FILE *file = num_words == 2 ? fopen(words[1], "r") : NULL;
    const double limit_K = sizeof(heatrun_real) < 8 ? 0.05 : 1e-6;
    static char line[2048];
    double row[NUM_COLUMNS], largest_K = 0.0;
    heatrun_state state;
    long num_steps = -1;
    int is_close = 1;
    if (file == NULL) {
        fprintf(stderr, "usage: replay vectors.csv\n");
        return 2;
    }
    while (fgets(line, (int)sizeof line, file) != NULL) {
        heatrun_status status;
        const double *next = row + 1;
        const double *expected = row + 1 + NUM_INPUTS;
        int i;
        if (!read_row(line, row)) {
            continue; /* the comment and the heading */
        }
        if (num_steps < 0) { /* the first row holds the start */
            heatrun_real start[HEATRUN_NUM_NODES];
            for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
                start[i] = (heatrun_real)expected[i];
            }
            status = heatrun_start(&state, start);
        } else {
            heatrun_inputs inputs;
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
            status = heatrun_step(&state, &inputs);
        }
        ++num_steps;
        if (status != HEATRUN_OK) {
            fprintf(stderr, "step %ld: status %d\n", num_steps, (int)status);
            fclose(file);
            return 1;
        }
        for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
            const double error_K = (double)state.temperature_degC[i] - expected[i];
            const double size_K = error_K < 0.0 ? -error_K : error_K;
            largest_K = size_K > largest_K ? size_K : largest_K;
            is_close = is_close && size_K <= limit_K; /* false for NaN */
        }
    }
    fclose(file);
    printf("%ld steps of %g s, largest difference %.3g K (limit %g K)\n", num_steps,
           (double)HEATRUN_STEP_S, largest_K, limit_K);
    return num_steps > 0 && is_close ? 0 : 1;
}
