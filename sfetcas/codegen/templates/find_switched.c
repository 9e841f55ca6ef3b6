    double acting[SF_SWITCHES];
    int rounds, worst, begun = 0, iterations = 0;
    sf_copy(acting, sf_acts, SF_SWITCHES);
    if (warm && sf_all_finite(own, SF_STATE)) sf_acting(own, acting);
    for (rounds = 0; rounds < SF_CHOICES; ++rounds) {
      sf_switch(m->given, acting);
@once@      sought.iterations += iterations;
      iterations = sought.iterations;
      if (status > @NAME@_UNSTABLE) {
        if (begun == 2 || status == @NAME@_BAD_ARGUMENT) break;
        /* Anew, with all strings and no stop, then with nothing. */
        for (i = 0; i < SF_SWITCHES; ++i) acting[i] = begun == 0 && sf_string[i] ? 1.0 : 0.0;
        ++begun;
        begins = SF_STARTED;
        if (begins) sf_copy(own, sf_start, SF_STATE);
        continue;
      }
      worst = sf_worst(m, own, acting);
      if (worst < 0) break;
      acting[worst] = 1.0 - acting[worst];
      begins = 2;
    }
    if (rounds == SF_CHOICES && status <= @NAME@_UNSTABLE) status = @NAME@_TOUCHES;
    for (i = 0; status <= @NAME@_UNSTABLE && i < SF_SWITCHES; ++i)
      own[acting[i] != 0.0 ? sf_opening_of[i] : sf_multiplier_of[i]] = 0.0;
    /* As a state alone says it: what neither pushes nor is open does not act. */
    sf_switch_as(m->given, own);
