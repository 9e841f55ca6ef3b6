    status = @NAME@_STALLED;
    sf_call(m, @name@_row, m->given, 0, 0, row);
    if (!sf_find(&model, &system, &sf_the_rules, &inputs, row, begins, own, &point, numbers, &sought))
      status = sought.status;
